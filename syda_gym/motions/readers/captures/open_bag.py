"""For ``in_child``: transforms and markers of a ROS bag or an MCAP as arrays."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

__all__ = ["arrays"]

_MOST = 4_000_000  # transforms and points
_READ = ("TFMessage", "tfMessage", "MarkerArray", "Marker")
_MAGIC = b"\x89MCAP"

Found = tuple[str, str, int, Any]
"""Topic, type, time of the log [ns] and message."""


def arrays(path: Path) -> dict[str, Any]:
    """Transforms ``(N, 11)`` and markers ``(N, 7)`` with the names that their numbers stand for, and topics."""
    frames: dict[str, int] = {}
    spaces: dict[str, int] = {}
    transforms: list[tuple[float, ...]] = []
    markers: list[tuple[float, ...]] = []
    topics: set[str] = set()
    for topic, kind, logged, message in (_from_mcap if _is_mcap(path) else _from_bag)(path, topics):
        if kind.endswith("/TFMessage") or kind.endswith("/tfMessage"):
            fixed = float(topic.endswith("tf_static"))
            for one in message.transforms:
                move, turn = one.transform.translation, one.transform.rotation
                names = _name(frames, one.child_frame_id), _name(frames, one.header.frame_id)
                transforms.append((
                    _seconds(one.header.stamp, logged), *names, move.x, move.y, move.z, turn.x, turn.y, turn.z, turn.w,
                    fixed,
                ))  # fmt: skip
        else:
            for one in getattr(message, "markers", [message]):
                markers += _marker(one, spaces, logged)
        if len(transforms) + len(markers) > _MOST:
            raise ValueError(f"more than {_MOST} transforms and markers; cut the bag into pieces")
    return {
        "frames": np.array([*frames, ""], dtype="U100"),
        "spaces": np.array([*spaces, ""], dtype="U100"),
        "transforms": np.array(transforms, dtype=np.float64).reshape(-1, 11),
        "markers": np.array(markers, dtype=np.float64).reshape(-1, 7),
        "topics": np.array([*sorted(topics)[:30], ""], dtype="U200"),
    }


def _is_mcap(path: Path) -> bool:
    if path.is_dir():
        return False
    with path.open("rb") as file:
        return file.read(len(_MAGIC)) == _MAGIC


def _from_bag(path: Path, topics: set[str]) -> Iterator[Found]:
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        topics.update(f"{c.topic} ({c.msgtype})" for c in reader.connections)
        wanted = [c for c in reader.connections if c.msgtype.rpartition("/")[2] in _READ]
        for connection, logged, raw in reader.messages(connections=wanted):
            yield connection.topic, connection.msgtype, logged, reader.deserialize(raw, connection.msgtype)


def _from_mcap(path: Path, topics: set[str]) -> Iterator[Found]:
    """MCAP of any profile: other channels in it may be JSON or Protobuf, which ``rosbags`` refuses as a whole."""
    from mcap.reader import make_reader

    store, wanted = get_typestore(Stores.ROS2_HUMBLE), []
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        if summary is None:  # its writer was killed; this library does not read on without an index
            yield from _from_bag(path, topics)
            return
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            kind = schema.name if schema else "no schema"
            topics.add(f"{channel.topic} ({kind})")
            if kind.rpartition("/")[2] in _READ and channel.message_encoding == "cdr":
                wanted.append(channel.topic)
        if not wanted:
            return
        for schema, channel, message in reader.iter_messages(topics=wanted):
            if schema is not None:
                yield channel.topic, schema.name, message.log_time, store.deserialize_cdr(message.data, schema.name)


def _marker(one: Any, spaces: dict[str, int], logged: int) -> list[tuple[float, ...]]:
    if one.action not in (0,):
        return []
    place = one.pose.position
    time, space = _seconds(one.header.stamp, logged), _name(spaces, f"{one.ns}|{one.text}"[:100])
    rows = [(p.x, p.y, p.z) for p in one.points] if one.type in (7, 8) and len(one.points) else []
    if rows:
        return [(time, space, one.id, number, *row) for number, row in enumerate(rows)]
    return [] if one.type in (4, 5) else [(time, space, one.id, -1, place.x, place.y, place.z)]


def _seconds(stamp: Any, logged: int) -> float:
    nanoseconds = getattr(stamp, "nanosec", getattr(stamp, "nsec", 0))
    time = stamp.sec + 1e-9 * nanoseconds
    return float(time) if time > 0 else 1e-9 * logged


def _name(names: dict[str, int], text: str) -> int:
    return names.setdefault(text[:100].lstrip("/"), len(names))
