"""A script, run in a process of its own: transforms and markers of a ROS bag as arrays (``open_bag.py BAG OUT``)."""

import sys
from typing import Any

__all__: list[str] = []

_MOST = 4_000_000  # transforms and points
_READ = ("TFMessage", "tfMessage", "MarkerArray", "Marker")


def _limit() -> None:
    """At most 20 s of processor time and 4 GB of addresses."""
    try:
        import resource
    except ImportError:  # there is none outside of Unix
        return
    resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _seconds(stamp: Any, logged: int) -> float:
    nanoseconds = getattr(stamp, "nanosec", getattr(stamp, "nsec", 0))
    time = stamp.sec + 1e-9 * nanoseconds
    return float(time) if time > 0 else 1e-9 * logged


def _name(names: dict[str, int], text: str) -> int:
    return names.setdefault(text[:100].lstrip("/"), len(names))


def _main(path: str, out: str) -> int:
    _limit()
    try:
        from pathlib import Path

        import numpy as np
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        return 3
    frames: dict[str, int] = {}
    spaces: dict[str, int] = {}
    transforms: list[tuple[float, ...]] = []
    markers: list[tuple[float, ...]] = []
    topics: set[str] = set()
    try:
        with AnyReader([Path(path)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            topics = {f"{c.topic} ({c.msgtype})" for c in reader.connections}
            wanted = [c for c in reader.connections if c.msgtype.rpartition("/")[2] in _READ]
            for connection, logged, raw in reader.messages(connections=wanted):
                message: Any = reader.deserialize(raw, connection.msgtype)
                if connection.msgtype.endswith("/TFMessage") or connection.msgtype.endswith("/tfMessage"):
                    fixed = float(connection.topic.endswith("tf_static"))
                    for one in message.transforms:
                        move, turn = one.transform.translation, one.transform.rotation
                        transforms.append((
                            _seconds(one.header.stamp, logged), _name(frames, one.child_frame_id), _name(frames,
                            one.header.frame_id),
                            move.x, move.y, move.z, turn.x, turn.y, turn.z, turn.w, fixed,
                        ))  # fmt: skip
                else:
                    for one in getattr(message, "markers", [message]):
                        if one.action not in (0,):
                            continue
                        place = one.pose.position
                        time, space = _seconds(one.header.stamp, logged), _name(spaces, f"{one.ns}|{one.text}"[:100])
                        rows = [(p.x, p.y, p.z) for p in one.points] if one.type in (7, 8) and len(one.points) else []
                        if rows:
                            markers += [(time, space, one.id, number, *row) for number, row in enumerate(rows)]
                        elif one.type not in (4, 5):
                            markers.append((time, space, one.id, -1, place.x, place.y, place.z))
                if len(transforms) + len(markers) > _MOST:
                    raise ValueError(f"more than {_MOST} transforms and markers; cut the bag into pieces")
        np.savez(
            out, frames=np.array([*frames, ""], dtype="U100"), spaces=np.array([*spaces, ""], dtype="U100"),
            transforms=np.array(transforms, dtype=np.float64).reshape(-1, 11),
            markers=np.array(markers, dtype=np.float64).reshape(-1, 7), topics=np.array([*sorted(topics)[:30], ""],
            dtype="U200"),
        )  # fmt: skip
    except Exception as error:  # whatever the library raises is said in one line
        print(str(error).splitlines()[0] if str(error) else type(error).__name__, file=sys.stderr)
        return 4
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1], sys.argv[2]))
