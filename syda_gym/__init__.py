"""Map a human's motion onto a humanoid, chain such maps, know which chain will work, and prove how good it is.

Importing the package registers ``SydaTeleop-v0`` and its family (``syda_gym.envs.family``) with Gymnasium. Everything
else, PyTorch and PyBullet included, is loaded when it is first used.

    import gymnasium as gym
    import syda_gym

    env = gym.make("SydaTeleop-v0")

``gym.make("syda_gym:SydaTeleop-v0")`` does both in one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from syda_gym.envs.family import register_family
from syda_gym.errors import SydaError

if TYPE_CHECKING:
    from syda_gym.embodiments.catalog import get as embodiment
    from syda_gym.embodiments.embodiment import Embodiment, landmark_error
    from syda_gym.embodiments.human import HumanSkeleton
    from syda_gym.embodiments.robot import Robot
    from syda_gym.envs.teleop import SydaTeleopEnv
    from syda_gym.envs.vector import SydaTeleopVectorEnv
    from syda_gym.mappings.chain import ChainMapping
    from syda_gym.mappings.fitting.fit import fit
    from syda_gym.mappings.mapping import Mapping
    from syda_gym.mappings.methods.unfitted import unfitted
    from syda_gym.mappings.storage import load_mapping, save_mapping
    from syda_gym.motions.clip import Motions, PairedMotions
    from syda_gym.motions.loading import load_motions
    from syda_gym.motions.readers.own.npz import save_motions
    from syda_gym.routes.metric import transferability
    from syda_gym.routes.routing import best_route, ranked_routes

__version__ = "0.2.0"

__all__ = [
    "ENV_ID",
    "ChainMapping",
    "Embodiment",
    "HumanSkeleton",
    "Mapping",
    "Motions",
    "PairedMotions",
    "Robot",
    "SydaError",
    "SydaTeleopEnv",
    "SydaTeleopVectorEnv",
    "__version__",
    "best_route",
    "embodiment",
    "fit",
    "landmark_error",
    "load_mapping",
    "load_motions",
    "ranked_routes",
    "save_mapping",
    "save_motions",
    "transferability",
    "unfitted",
]

ENV_ID = "SydaTeleop-v0"

# Public name -> the module that holds it and its name there.
_LAZY: dict[str, tuple[str, str]] = {
    "ChainMapping": ("mappings.chain", "ChainMapping"),
    "Embodiment": ("embodiments.embodiment", "Embodiment"),
    "HumanSkeleton": ("embodiments.human", "HumanSkeleton"),
    "Mapping": ("mappings.mapping", "Mapping"),
    "Motions": ("motions.clip", "Motions"),
    "PairedMotions": ("motions.clip", "PairedMotions"),
    "Robot": ("embodiments.robot", "Robot"),
    "SydaTeleopEnv": ("envs.teleop", "SydaTeleopEnv"),
    "SydaTeleopVectorEnv": ("envs.vector", "SydaTeleopVectorEnv"),
    "best_route": ("routes.routing", "best_route"),
    "embodiment": ("embodiments.catalog", "get"),
    "fit": ("mappings.fitting.fit", "fit"),
    "landmark_error": ("embodiments.embodiment", "landmark_error"),
    "load_mapping": ("mappings.storage", "load_mapping"),
    "load_motions": ("motions.loading", "load_motions"),
    "ranked_routes": ("routes.routing", "ranked_routes"),
    "save_mapping": ("mappings.storage", "save_mapping"),
    "save_motions": ("motions.readers.own.npz", "save_motions"),
    "transferability": ("routes.metric", "transferability"),
    "unfitted": ("mappings.methods.unfitted", "unfitted"),
}


def __getattr__(name: str) -> Any:
    """Loads a public name on first use (PEP 562)."""
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; public are {', '.join(__all__)}")
    module, attribute = _LAZY[name]
    return getattr(import_module(f"{__name__}.{module}"), attribute)


def __dir__() -> list[str]:
    """Every public name, also those that are not loaded yet."""
    return sorted({*globals(), *__all__})


register_family()
