"""Finding frames, people and points in JSON, however a tracker has nested them."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MotionError
from syda_gym.files import shortened

__all__ = ["Person", "frames_of", "people_of", "time_of"]

_FRAMES = ("frames", "data", "instance_info", "results", "annotations", "poses", "sequence", "body_frames",
"bodyFrames", "Frames",
           "samples", "skeletonFrames")  # fmt: skip
_PEOPLE = (
    "bodies",
    "people",
    "persons",
    "instances",
    "skeletons",
    "Bodies",
    "Skeletons",
    "users",
    "tracked_bodies",
    "predictions",
)
_WORLD = ("pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks", "landmarks_world",
"keypoints3D",
          "keypoints_3d", "keypoints3d", "pose_keypoints_3d", "joints_3d", "joints3d", "joint_positions",
          "jointPositions",
          "pred_xyz_jts", "landmarks", "joints", "Joints", "positions", "skeleton", "keypoints", "points", "pose",
          "body",
          "keypoint", "landmark", "JointPositions")  # fmt: skip
_IMAGE = ("pose_landmarks", "poseLandmarks", "pose_keypoints_2d", "keypoints_2d", "keypoints2D")
_SURE = ("visibility", "score", "confidence", "tracking_state", "trackingState", "TrackingState", "confidence_level",
"likelihood",
         "keypoint_scores", "joint_confidences", "Confidence")  # fmt: skip
_NESTED = ("position", "Position", "world", "real", "location", "translation", "pos", "coordinates", "cameraSpacePoint")
_NAMES = ("name", "part", "joint", "type", "joint_name", "JointType", "jointType", "bodyPart", "label")
_IDS = (
    "body_id",
    "bodyId",
    "id",
    "trackingId",
    "tracking_id",
    "track_id",
    "person_id",
    "TrackingId",
    "user_id",
    "idx",
    "person",
)
_AXES = (("x", "y", "z"), ("X", "Y", "Z"), ("cameraX", "cameraY", "cameraZ"))
_CLOCKS = (
    ("timestamp_ms", "ms"), ("timestampInMilliseconds", "ms"), ("time_ms", "ms"), ("timestamp_usec", "us"),
    ("timestampUs", "us"),
    ("timestamp_us", "us"), ("time_us", "us"), ("device_timestamp_usec", "us"), ("timestamp_ns", "ns"),
    ("timestamp_s", "s"),
    ("time_s", "s"), ("relativeTime", None), ("RelativeTime", None), ("timestamp", None), ("time", None),
    ("Timestamp", None),
    ("timeStamp", None), ("t", None), ("ts", None),
)  # fmt: skip
_STATES = {"NotTracked": 0.0, "Inferred": 1.0, "Tracked": 2.0}
_MOST_POINTS = 600


@dataclass
class Person:
    """One person in one frame.

    Attributes:
        identity: who it is, where the file says so.
        names: names of the points, where the file has them.
        points: ``(P, 4)`` x, y, z and certainty; not a number where unknown.
    """

    identity: str | None
    names: tuple[str, ...]
    points: FloatArray


def frames_of(path: Path, document: Any) -> tuple[list[Any], Mapping[str, Any]]:
    """The list of frames in a document, and the document's own keys around it.

    Raises:
        MotionError: there is no list of frames; the message lists the keys.
    """
    if isinstance(document, list):
        return document, {}
    if isinstance(document, Mapping):
        for key in _FRAMES:
            if isinstance(document.get(key), list):
                return document[key], document
            if (
                isinstance(document.get(key), Mapping)
                and document[key]
                and all(str(k).isdigit() for k in document[key])
            ):
                return [document[key][k] for k in sorted(document[key], key=lambda one: int(str(one)[:18]))], document
        if document and all(str(key).isdigit() for key in document):
            return [document[key] for key in sorted(document, key=lambda one: int(str(one)[:18]))], {}
        for key in _WORLD:
            if isinstance(document.get(key), list) and _depth(document[key]) >= 3:
                return document[key], document
        if document and all(
            isinstance(value, list) and len(value) > 1 and _depth(value) == 2 for value in document.values()
        ):
            return _by_joint(path, document), {}
        if any(key in document for key in (*_PEOPLE, *_WORLD, *_IMAGE)):
            return [document], {}
    came = (
        f"an object with the keys {', '.join(map(str, list(document)[:8]))[:160]}"
        if isinstance(document, Mapping)
        else "no list"
    )
    raise MotionError(f"{path}: expected a list of frames, or an object with one under 'frames'; got {came}")


def people_of(path: Path, index: int, frame: Any, common: tuple[str, ...]) -> list[Person]:
    """Everybody in one frame.

    Args:
        path: file, for messages.
        index: of the frame, for messages.
        frame: what stands in the file.
        common: names of points that stand above the frames.

    Raises:
        MotionError: what is there are no points in space.
    """
    where = f"{path}, frame {index}"
    if frame is None:
        return []
    if isinstance(frame, Mapping):
        for key in _PEOPLE:
            if isinstance(frame.get(key), list | Mapping):
                bodies = frame[key]
                listed = list(bodies.values()) if isinstance(bodies, Mapping) else bodies
                if len(listed) > 100:
                    raise MotionError(f"{where}: {len(listed)} people; at most 100 are read")
                return [person for body in listed for person in _person(where, body, common)]
    if _is_group(frame):
        return [person for body in frame for person in _person(where, body, common)]
    return _person(where, frame, common)


def time_of(path: Path, index: int, frame: Any) -> tuple[float, str | None, str] | None:
    """Time of a frame as it stands in the file, its unit if the name says it, and the name.

    Raises:
        MotionError: it is no number.
    """
    if not isinstance(frame, Mapping):
        return None
    for key, unit in _CLOCKS:
        if frame.get(key) is not None:
            value = frame[key]
            if isinstance(value, str):
                with contextlib.suppress(ValueError):
                    value = float(value)
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e20:
                raise MotionError(f"{path}, frame {index}: {key} is no number: {shortened(value, 60)}")
            return float(value), unit, key
    return None


def _by_joint(path: Path, document: Mapping[str, Any]) -> list[Any]:
    """Joint to its places over time becomes a list of frames."""
    lengths = {len(value) for value in document.values()}
    if len(lengths) != 1:
        raise MotionError(
            f"{path}: the joints {', '.join(list(document)[:5])[:100]} have unequally many frames {sorted(lengths)[:6]}"
        )
    return [dict(zip(document, row, strict=True)) for row in zip(*document.values(), strict=True)]


def _person(where: str, body: Any, common: tuple[str, ...]) -> list[Person]:
    """The points of one body; none if it is empty, several if it is a group."""
    identity = None
    if isinstance(body, Mapping):
        identity = next((shortened(body[key], 40) for key in _IDS if isinstance(body.get(key), int | str)), None)
        if body.get("tracked") is False:
            return []
        key = next((name for name in _WORLD if name in body and body[name] is not None), None)
        if key is None:
            if any(name in body for name in _IMAGE):
                raise MotionError(f"{where}: only image landmarks ({', '.join(k for k in _IMAGE if k in body)}), "
                f"whose depth is unknown; "
                                  "dump pose_world_landmarks instead")  # fmt: skip
            if not _is_named(body):
                if any(name in body for name in _WORLD):
                    return []
                keys = ", ".join(map(str, list(body)[:8]))[:120]
                raise MotionError(
                    f"{where}: expected a key 'pose_world_landmarks' (or keypoints3D, joints, bodies and the like), "
                    f"got {keys}"
                )
            points: Any = body
        else:
            points = body[key]
            sure = next((body[name] for name in _SURE if isinstance(body.get(name), list)), None)
            if sure is not None and isinstance(points, list) and len(sure) == len(points):
                points = [
                    [*point[:3], value] if isinstance(point, list) else point
                    for point, value in zip(points, sure, strict=True)
                ]
            if isinstance(points, Mapping) and isinstance(points.get("landmark"), list):
                points = points["landmark"]
            if _is_group(points):
                return [person for one in points for person in _person(where, one, common)]
    else:
        points = body
    if points is None or (isinstance(points, list | Mapping) and len(points) == 0):
        return []
    names, table = _points(where, points)
    return [Person(identity, names or (common if len(common) == len(table) else ()), table)]


def _points(where: str, points: Any) -> tuple[tuple[str, ...], FloatArray]:
    """Names, if there are any, and ``(P, 4)``."""
    if isinstance(points, Mapping):
        kept = {str(name): value for name, value in points.items() if _is_point(value)}
        if not kept:
            raise MotionError(f"{where}: expected points with x, y and z, got {shortened(points, 100)}")
        if len(kept) > _MOST_POINTS:
            raise MotionError(f"{where}: {len(kept)} points; at most {_MOST_POINTS} are read")
        return tuple(name[:100] for name in kept), np.array(
            [_point(where, name, value) for name, value in kept.items()]
        )
    if not isinstance(points, list):
        raise MotionError(f"{where}: expected landmarks, got {type(points).__name__}")
    if len(points) > 4 * _MOST_POINTS:
        raise MotionError(f"{where}: {len(points)} values; at most {_MOST_POINTS} points are read")
    if all(isinstance(value, int | float) or value is None for value in points):
        return (), _flat(where, points)
    table = np.array([_point(where, number, value) for number, value in enumerate(points)])
    names = [next((value[key] for key in _NAMES if isinstance(value.get(key), str)), None) if isinstance(value,
    Mapping) else None
             for value in points]  # fmt: skip
    return (tuple(str(name)[:100] for name in names) if all(names) and len(set(names)) == len(names) else ()), table


def _flat(where: str, values: list[Any]) -> FloatArray:
    """Numbers one after the other: x, y, z or x, y, z and certainty."""
    for width in (4, 3):
        if len(values) % width == 0 and len(values) // width >= 5:
            table = np.array(
                [_point(where, i, values[width * i : width * (i + 1)]) for i in range(len(values) // width)]
            )
            if width == 3 or ((table[:, 3] >= 0.0) & (table[:, 3] <= 1.0) | np.isnan(table[:, 3])).all():
                return table
    raise MotionError(f"{where}: {len(values)} numbers, which are neither points of 3 nor of 4; expected landmarks")


def _point(where: str, number: object, value: Any) -> list[float]:
    """x, y, z and certainty."""
    found: list[Any] = []
    sure: Any = None
    if isinstance(value, Mapping):
        sure = next((value[key] for key in _SURE if key in value), None)
        inner = next((value[key] for key in _NESTED if isinstance(value.get(key), Mapping | list)), value)
        if isinstance(inner, Mapping):
            axes = next((axes for axes in _AXES if all(axis in inner for axis in axes)), None)
            found = [inner[axis] for axis in axes] if axes else []
            if not found and {"x", "y"} <= set(inner):
                raise MotionError(
                    f"{where}, landmark {number}: x and y only: a place in a picture, whose depth is unknown"
                )
        else:
            found = list(inner[:3])
    elif isinstance(value, list):
        if len(value) == 2 and all(isinstance(one, int | float) for one in value):
            raise MotionError(
                f"{where}, landmark {number}: expected x, y, z, got two numbers: a place in a picture, whose depth "
                f"is unknown"
            )
        found = value[:3]
        sure = value[3] if len(value) in (4, 5) else None
    if isinstance(sure, str):
        sure = _STATES.get(sure)
    numbers = [*found, float("nan") if sure is None else sure]
    numbers = [float("nan") if one is None else one for one in numbers]
    if len(found) != 3 or any(
        isinstance(one, bool) or not isinstance(one, int | float) or abs(one) >= 1e9 for one in numbers
    ):
        raise MotionError(
            f"{where}, landmark {number}: expected x, y, z and visibility as numbers, got {shortened(value, 80)}"
        )
    return [float(one) for one in numbers]


def _is_point(value: Any) -> bool:
    if isinstance(value, Mapping):
        return any(all(axis in value for axis in axes) for axes in _AXES) or any(key in value for key in _NESTED)
    return (
        isinstance(value, list)
        and 3 <= len(value) <= 5
        and all(isinstance(one, int | float) or one is None for one in value)
    )


def _is_named(body: Mapping[str, Any]) -> bool:
    return sum(_is_point(value) for value in body.values()) >= 3


def _is_group(value: Any) -> bool:
    """Whether a list holds people rather than points."""
    if not isinstance(value, list) or not value or len(value) > 100:
        return False
    first = next((one for one in value if one), None)
    if isinstance(first, Mapping):
        return any(isinstance(first.get(key), list | Mapping) for key in (*_WORLD, *_IMAGE)) and not _is_point(first)
    return isinstance(first, list) and len(first) > 5 and isinstance(first[0], list | Mapping)


def _depth(value: Any) -> int:
    depth = 0
    while isinstance(value, list) and value and depth < 6:
        value, depth = value[0], depth + 1
    return depth + (1 if isinstance(value, Mapping) else 0)
