"""Messages of a run: plain values made from ticks, decisions and the operator's points; knows no file."""

from __future__ import annotations

import math
from typing import Any

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.look import OPERATOR, rgba
from syda_gym.teleoperation.tick import Decision, Tick

__all__ = ["OPERATOR_FRAME", "POINT_NAMES", "decision_message", "named_points", "scene_message", "split_time"]

OPERATOR_FRAME = "operator"
"""Frame of the operator's points: x forward, y left, z up [m], between the shoulders."""

POINT_NAMES = ("shoulder", "elbow", "hand")
"""What the points of an arm (``ARM_POINTS``) are called in ``tf``, in the words of usual trackers."""

_THICK, _BALL = 0.035, 0.07  # m
_UPRIGHT = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


def split_time(seconds: float) -> tuple[int, int]:
    """Whole seconds and nanoseconds."""
    whole = math.floor(seconds)
    nanoseconds = round((seconds - whole) * 1e9)
    return (whole + 1, 0) if nanoseconds == 10**9 else (whole, nanoseconds)


def decision_message(tick: Tick, decision: Decision) -> dict[str, Any]:
    """A decision as ``syda_gym.Decision``."""
    seen = tick.frame is not None
    return {
        "state": decision.state.value,
        "factor": decision.factor,
        "bound": decision.bound if math.isfinite(decision.bound) else None,
        "reasons": list(decision.reasons),
        "tracking": tick.tracking if seen else None,
        "age": tick.now - tick.sent if seen and tick.sent is not None else None,
        "controls": list(tick.controls),
        "frame": [] if tick.frame is None else tick.frame.tolist(),
    }


def named_points(body: Embodiment, frame: FloatArray) -> dict[str, tuple[float, float, float]]:
    """Where shoulders, elbows and hands are, by names such as ``left_elbow``.

    Args:
        body: whose frame it is.
        frame: ``(F,)``, calibrated.
    """
    points = body.arm_points(frame)[0]
    return {
        f"{side}_{name}": (float(x), float(y), float(z))
        for side, arm in zip(body.sides, points.tolist(), strict=True)
        for name, (x, y, z) in zip(POINT_NAMES, arm, strict=True)
    }


def scene_message(now: float, points: dict[str, tuple[float, float, float]]) -> dict[str, Any]:
    """Points as ``foxglove.SceneUpdate``: a stick for each arm and between the shoulders, a ball for each point."""
    places = {name: dict(zip("xyz", point, strict=True)) for name, point in points.items()}
    names = list(places)
    arms = [names[at : at + len(POINT_NAMES)] for at in range(0, len(names), len(POINT_NAMES))]
    sticks = [[places[name] for name in arm] for arm in arms]
    if len(arms) == 2:
        sticks.append([places[arm[0]] for arm in arms])
    sec, nsec = split_time(now)
    colour = dict(zip("rgba", rgba(OPERATOR), strict=True))
    entity = {
        "timestamp": {"sec": sec, "nsec": nsec},
        "frame_id": OPERATOR_FRAME,
        "id": "operator",
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        "metadata": [],
        "arrows": [],
        "cubes": [],
        "spheres": [
            {"pose": {**_UPRIGHT, "position": place}, "size": {axis: _BALL for axis in "xyz"}, "color": colour}
            for place in places.values()
        ],
        "cylinders": [],
        "lines": [
            {
                "type": 0,
                "pose": _UPRIGHT,
                "thickness": _THICK,
                "scale_invariant": False,
                "points": stick,
                "color": colour,
                "colors": [],
                "indices": [],
            }
            for stick in sticks
        ],
        "triangles": [],
        "texts": [],
        "models": [],
    }
    return {"deletions": [], "entities": [entity]}
