"""McapJournal: a run as MCAP, written as it goes; what Foxglove, Rerun and ROS show of it."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MissingExtraError, TeleoperationError
from syda_gym.teleoperation.bags.messages import (
    OPERATOR_FRAME,
    decision_message,
    named_points,
    scene_message,
    split_time,
)
from syda_gym.teleoperation.bags.schemas import DECISION, DROPPED, SCENE
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision, Tick

__all__ = ["TOPICS", "McapJournal", "run_facts"]

TOPICS: dict[str, str] = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/rosout": "rcl_interfaces/msg/Log",
    "/robot_description": "std_msgs/msg/String",
    "/decision": "syda_gym.Decision",
    "/dropped": "syda_gym.Dropped",
    "/operator": "foxglove.SceneUpdate",
}
"""Topics and their schemas: messages of ROS 2 (CDR), and JSON with a JSON schema."""

_JSON = {"syda_gym.Decision": DECISION, "syda_gym.Dropped": DROPPED, "foxglove.SceneUpdate": SCENE}
_INFO, _WARN = 20, 30
_BESIDE = 1.1  # m from the robot's torso to where the operator is shown
_CHUNK = 128 * 1024  # bytes until what was written is on its way to the disk


class McapJournal:
    """Writes commands, the operator's points, decisions with their reasons, and changes in words.

    A journal to look at: it holds what was decided, and the frames as they came, but not what replays bit for bit
    (``Journal`` does). Like that one it is written as it goes; a file whose end is missing can be recovered with
    ``mcap recover``.

    Args:
        path: a new file.
        robot: whose joints are commanded.
        operator: whose calibrated frames are shown.
        shown: the operator's last calibrated frame ``(F,)``, or ``None``; asked after each decision on a frame.
        facts: for the file's metadata, by name.

    Raises:
        MissingExtraError: mcap or rosbags is not installed.
        TeleoperationError: the file exists or cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        robot: Robot,
        operator: Embodiment,
        shown: Callable[[], FloatArray | None],
        facts: dict[str, Any],
    ) -> None:
        try:
            from mcap.writer import Writer
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise MissingExtraError("writing MCAP", "ros") from error
        self.path = Path(path)
        self._robot, self._operator, self._shown = robot, operator, shown
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        self._said: tuple[Any, ...] = ()
        self._sequence = 0
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file: IO[bytes] = open(self.path, "xb")  # noqa: SIM115 (closed at the end of the run)
        except OSError as error:
            raise TeleoperationError(
                f"cannot write {self.path}: {error.strerror}; choose a new file in a folder you may write"
            ) from error
        self._writer: Any = Writer(self._file, chunk_size=_CHUNK)
        self._writer.start(profile="ros2", library="syda_gym")
        self._channels = {topic: self._channel(topic, schema) for topic, schema in TOPICS.items()}
        self._writer.add_metadata("syda_gym", {name: _text(value) for name, value in facts.items()})
        self._described = False

    @classmethod
    def of(cls, path: str | os.PathLike[str], loop: TeleoperationLoop, note: dict[str, Any] | None = None) -> Any:
        """Of a loop that is about to run; see the class for what it raises."""
        return cls(path, loop.robot, loop.mapping.source, lambda: loop.frame, run_facts(loop, note))

    def decided(self, tick: Tick, decision: Decision) -> None:
        """Writes one tick and its decision.

        Raises:
            OSError: the disk is full, for example.
        """
        now = tick.now
        if not self._described:
            self._describe(now)
        self._ros("/joint_states", now, name=list(self._robot.joint_names), position=decision.command)
        self._json("/decision", now, decision_message(tick, decision))
        frame = None if tick.frame is None else self._shown()
        if frame is not None:
            points = named_points(self._operator, frame)
            self._json("/operator", now, scene_message(now, points))
            self._transforms(now, points)
        said = (decision.state, decision.reasons)
        if said != self._said:
            self._said = said
            text = ": ".join(part for part in (decision.state.value, "; ".join(decision.reasons)) if part)
            self._log(now, text, _WARN if decision.reasons else _INFO)

    def dropped(self, now: float, counts: dict[str, int]) -> None:
        """Writes how many packets have been dropped by ``now`` before they reached the loop, by reason."""
        self._json("/dropped", now, {"counts": counts})

    def flush(self) -> None:
        """Hands what is complete to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Ends the file; harmless when repeated, or after ``abandon``.

        Raises:
            TeleoperationError: the end could not be written.
        """
        if self._file.closed:
            return
        try:
            self._writer.finish()
            self._file.close()
        except OSError as error:
            self.abandon()
            raise TeleoperationError(f"{self.path} could not be ended: {error.strerror or error}") from error

    def abandon(self) -> None:
        """Lets go of the file as it is, after an error; it has no end then."""
        with contextlib.suppress(OSError, ValueError):
            self._file.close()

    def __enter__(self) -> McapJournal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _channel(self, topic: str, schema: str) -> int:
        if schema in _JSON:
            known = self._writer.register_schema(schema, "jsonschema", json.dumps(_JSON[schema]).encode())
            return int(self._writer.register_channel(topic, "json", known))
        text = self._types.generate_msgdef(schema, ros_version=2)[0]
        known = self._writer.register_schema(schema, "ros2msg", text.encode())
        return int(self._writer.register_channel(topic, "cdr", known))

    def _write(self, topic: str, now: float, data: bytes) -> None:
        stamp = round(now * 1e9)
        self._sequence += 1
        self._writer.add_message(
            self._channels[topic], log_time=stamp, publish_time=stamp, data=data, sequence=self._sequence
        )

    def _json(self, topic: str, now: float, value: dict[str, Any]) -> None:
        self._write(topic, now, json.dumps(value, separators=(",", ":")).encode())

    def _send(self, topic: str, now: float, message: Any) -> None:
        self._write(topic, now, bytes(self._types.serialize_cdr(message, TOPICS[topic])))

    def _ros(self, topic: str, now: float, *, name: list[str], position: FloatArray) -> None:
        kinds, nothing = self._types.types, np.zeros(0)
        self._send(
            topic,
            now,
            kinds[TOPICS[topic]](
                header=self._header(now, ""), name=name, position=position, velocity=nothing, effort=nothing
            ),
        )

    def _transforms(self, now: float, points: dict[str, tuple[float, float, float]]) -> None:
        kinds = self._types.types
        torso = self._robot.description.torso
        places = [(torso, OPERATOR_FRAME, (0.0, _BESIDE, 0.0))]
        places += [(OPERATOR_FRAME, name, point) for name, point in points.items()]
        transforms = [
            kinds["geometry_msgs/msg/TransformStamped"](
                header=self._header(now, parent),
                child_frame_id=child,
                transform=kinds["geometry_msgs/msg/Transform"](
                    translation=kinds["geometry_msgs/msg/Vector3"](x=x, y=y, z=z),
                    rotation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                ),
            )
            for parent, child, (x, y, z) in places
        ]
        self._send("/tf", now, kinds[TOPICS["/tf"]](transforms=transforms))

    def _log(self, now: float, text: str, level: int) -> None:
        message = self._types.types[TOPICS["/rosout"]](
            stamp=self._stamp(now), level=level, name="syda_gym", msg=text, file="", function="", line=0
        )
        self._send("/rosout", now, message)

    def _describe(self, now: float) -> None:
        """The robot's URDF, which viewers draw by the joint states."""
        self._described = True
        if self._robot.urdf.suffix == ".urdf":
            text = self._robot.urdf.read_text(encoding="utf-8")
            topic = "/robot_description"
            self._send(topic, now, self._types.types[TOPICS[topic]](data=text))

    def _stamp(self, now: float) -> Any:
        sec, nanosec = split_time(now)
        return self._types.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)

    def _header(self, now: float, frame: str) -> Any:
        return self._types.types["std_msgs/msg/Header"](stamp=self._stamp(now), frame_id=frame)


def run_facts(loop: TeleoperationLoop, note: dict[str, Any] | None) -> dict[str, Any]:
    """What a run is made of, for the metadata of its file."""
    return {
        "route": list(loop.mapping.route),
        "mapping": loop.mapping.card.to_json(),
        "robot": loop.robot.spec(),
        "settings": loop.settings.to_json(),
        "note": note or {},
        "written": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)
