"""Schemas of what a run's MCAP holds: JSON schemas of our own messages and of Foxglove's scene."""

from __future__ import annotations

from typing import Any

__all__ = ["DECISION", "DROPPED", "SCENE"]

_NUMBER, _TEXT, _WHOLE = {"type": "number"}, {"type": "string"}, {"type": "integer"}
_MAYBE = {"type": ["number", "null"]}
_TIME = {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}}
_VECTOR = {"type": "object", "properties": {axis: _NUMBER for axis in "xyz"}}
_TURN = {"type": "object", "properties": {axis: _NUMBER for axis in "xyzw"}}
_POSE = {"type": "object", "properties": {"position": _VECTOR, "orientation": _TURN}}
_COLOUR = {"type": "object", "properties": {channel: _NUMBER for channel in "rgba"}}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _object(title: str, description: str, **properties: dict[str, Any]) -> dict[str, Any]:
    return {"title": title, "description": description, "type": "object", "properties": properties}


DECISION = _object(
    "syda_gym.Decision",
    "What one step of the live loop saw and decided",
    state={**_TEXT, "description": "calibrating, following, holding, easing, resting, paused or stopped"},
    factor={**_NUMBER, "description": "share of the speed that is allowed, 0 to 1"},
    bound={**_MAYBE, "description": "error bound of the mapped frame [m]; null without one"},
    reasons={**_list(_TEXT), "description": "why the robot is slowed or held, or the frame was dropped"},
    tracking={**_MAYBE, "description": "confidence of the source in the frame, 0 to 1; null without a frame"},
    age={**_MAYBE, "description": "time since the sender's clock, only differences count [s]; null without a frame"},
    controls={**_list(_TEXT), "description": "requests of the operator"},
    frame={**_list(_NUMBER), "description": "the source's frame as it came, in its own unit and axes; may be empty"},
)
DROPPED = _object(
    "syda_gym.Dropped",
    "Packets that were dropped before they reached the loop, all so far, by reason",
    counts={"type": "object", "additionalProperties": _WHOLE},
)
SCENE = _object(
    "foxglove.SceneUpdate",
    "The operator as balls and sticks",
    deletions=_list({"type": "object", "properties": {"timestamp": _TIME, "type": _WHOLE, "id": _TEXT}}),
    entities=_list(
        {
            "type": "object",
            "properties": {
                "timestamp": _TIME,
                "frame_id": _TEXT,
                "id": _TEXT,
                "lifetime": _TIME,
                "frame_locked": {"type": "boolean"},
                "metadata": _list({"type": "object", "properties": {"key": _TEXT, "value": _TEXT}}),
                "arrows": _list({"type": "object"}),
                "cubes": _list({"type": "object"}),
                "spheres": _list({"type": "object", "properties": {"pose": _POSE, "size": _VECTOR, "color": _COLOUR}}),
                "cylinders": _list({"type": "object"}),
                "lines": _list(
                    {
                        "type": "object",
                        "properties": {
                            "type": _WHOLE,
                            "pose": _POSE,
                            "thickness": _NUMBER,
                            "scale_invariant": {"type": "boolean"},
                            "points": _list(_VECTOR),
                            "color": _COLOUR,
                            "colors": _list(_COLOUR),
                            "indices": _list(_WHOLE),
                        },
                    }
                ),
                "triangles": _list({"type": "object"}),
                "texts": _list({"type": "object"}),
                "models": _list({"type": "object"}),
            },
        }
    ),
)
