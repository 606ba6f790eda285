"""The names that options take, spelled out so that help loads nothing heavy; a test compares them with reality."""

from __future__ import annotations

__all__ = [
    "ACTING",
    "ALGORITHMS",
    "AXES",
    "BODIES",
    "CAMERAS",
    "CELLS",
    "CONFIGS",
    "DATA_SETS",
    "DEFINITIONS",
    "FIGURES",
    "FORMATS",
    "KINDS",
    "LEVELS",
    "METHODS",
    "PHYSICS",
    "PREDICTORS",
    "PRESETS",
    "PROTOCOLS",
    "REFERENCES",
    "RIVALS",
    "SHIPPED_AGENTS",
    "SINGLE_DISTURBANCES",
    "SINKS",
    "SOURCES",
    "STACK",
    "ticked",
]

BODIES = ("adult", "kid", "pepper", "nao", "child", "left_only", "long_arms", "stiff", "tall")
"""Bodies of the catalog; robots that the user added come to them."""

FORMATS = (
    "paper", "pairs", "npz", "bvh", "c3d", "mvnx", "bag", "kinect", "azure", "openni", "film", "mediapipe", "keypoints",
    "table",
)  # fmt: skip
"""Prefixes of ``format:PATH``; see ``syda-gym motions formats``."""

METHODS: dict[str, tuple[str, ...]] = {
    "syda": ("general", "synergies", "nested", "accurate", "interpolation", "paper"),
    "direct": ("general", "paper"),
    "ridge": ("general",),
    "kernel_ridge": ("general",),
    "nearest": ("general",),
    "geometric": ("procrustes", "fixed"),
    "mink": ("procrustes",),
}
"""Methods of mappings and their presets, the default first."""

PRESETS = tuple(dict.fromkeys(preset for presets in METHODS.values() for preset in presets))
"""Every preset of a mapping's method."""

CELLS = ("lag", "noise", "latency", "noise+latency", "full")
"""Cells of the standard suite of disturbances."""

LEVELS = ("train", "test", "harsh")
"""Levels of disturbances."""

SINGLE_DISTURBANCES = (
    "skeleton_noise", "dropout", "link", "packet_loss", "weak_motors", "payload", "friction", "wrong_scale",
    "dynamics",
)  # fmt: skip
"""Disturbances that are written ``NAME:LEVEL``."""

PROTOCOLS = ("rand3", "twin3", "loao")
"""Ways to hold out frames."""

DEFINITIONS = ("dry_run", "general", "paper")
"""Definitions of transferability."""

PREDICTORS = ("dry_run", "T", "C", "L", "coverage", "arm_length_ratio", "hops", "measured")
"""What a route can be chosen by."""

RIVALS = (
    "base", "lead", "adaptive_lead", "one_euro", "one_euro_lead", "ema_lead", "projection", "projection_lead",
    "sliding_lead", "kalman",
)  # fmt: skip
"""Classical agents."""

SHIPPED_AGENTS = tuple(
    f"{route}-{cell}"
    for route in ("adult-kid-pepper", "adult-pepper")
    for cell in ("full", "lag", "latency", "noise", "noise-latency")
)
"""Agents that come with the package."""

ACTING = (*RIVALS, *SHIPPED_AGENTS)
"""Every agent that is known by name."""

STACK = "stack"
"""The base of a residual policy that stands on a predictor, which is trained first."""

KINDS = ("residual", "predictor")
"""What ``train`` trains."""

CONFIGS = ("undisturbed", "teleop", "contact", "short")
"""Hyper-parameters of a residual policy that come with the package."""

ALGORITHMS = ("ppo", "sac", "tqc")
"""Algorithms of reinforcement learning."""

PHYSICS = ("bullet", "servo")
"""Simulations."""

REFERENCES = ("auto", "paired", "mapped")
"""What errors are measured against."""

AXES = ("kinect", "ros", "camera", "unity")
"""Axes of a live source."""

SOURCES = ("camera[:N]", "film:FILE.mp4", "replay:SPEC", "udp:PORT", "udp:HOST:PORT", "ws:PORT")
"""How live sources are written."""

SINKS = ("bullet", "window", "video:FILE.mp4", "udp:HOST:PORT", "naoqi:URL", "none")
"""How live sinks are written."""

FIGURES = (
    "landmark_error", "joint_error", "mapping_error", "success", "jitter", "speed_violations", "limit_violations",
    "self_collisions", "coverage", "bound", "reward",
)  # fmt: skip
"""Figures of a benchmark."""


DATA_SETS = ("minari", "lerobot")
"""Formats of exported episodes."""

CAMERAS = ("front", "side", "scene")
"""Cameras that film exported episodes."""


def ticked(names: tuple[str, ...]) -> str:
    """Names for a help text: "`a`, `b`, `c`"."""
    return ", ".join(f"`{name}`" for name in names)
