"""Addresses: sources and sinks named in one word, such as ``udp:9870`` or ``video:run.mp4``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MotionError, OptionError, TeleoperationError, nearest_name
from syda_gym.motions.clip import MotionClip
from syda_gym.motions.how_to_read import AS_IT_STANDS, HowToRead
from syda_gym.teleoperation.incoming.camera import CameraSource, FilmSource
from syda_gym.teleoperation.incoming.network import UdpSource, WebSocketSource
from syda_gym.teleoperation.incoming.sources import ReplaySource, Source
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink, Sink, UdpSink

__all__ = ["SINKS", "SOURCES", "host_and_port", "make_sink", "make_source", "read_token"]

SOURCES = {
    "replay": "replay:SPEC plays a recording at its own speed; SPEC is embedded, format:PATH or a path",
    "udp": "udp[:HOST]:PORT listens for JSON packets",
    "ws": "ws[:HOST]:PORT serves a WebSocket for the same packets",
    "camera": "camera[:N] follows the person in front of a camera of this machine",
    "film": "film:FILE.mp4 follows the person in a film",
}
"""Kinds of sources and how they are written."""

SINKS = {
    "bullet": "a simulated robot, unseen",
    "window": "a simulated robot in PyBullet's window",
    "video": "video:FILE.mp4 films a simulated robot",
    "udp": "udp[:HOST]:PORT sends JSON joint commands",
    "naoqi": "naoqi:tcp://HOST:9559 drives a Pepper or NAO",
    "none": "commands go nowhere but into the journal",
}
"""Kinds of sinks and how they are written."""

_STAND = 1.25  # a replayed recording stands this much longer than the calibration takes


def make_source(
    spec: str,
    body: Embodiment,
    *,
    token: str | None = None,
    speed: float = 1.0,
    actions: Sequence[str] = (),
    calibration: float = 2.0,
    repeat: bool = False,
    origins: tuple[str, ...] = (),
    model: str | os.PathLike[str] | None = None,
    how: HowToRead = AS_IT_STANDS,
) -> Source:
    """A source from its address.

    Args:
        spec: see ``SOURCES``.
        body: whose frames the mapping takes.
        token: secret of network sources.
        speed: of a replay.
        actions: which actions a replay plays; all if empty.
        calibration: seconds of standing that a replay begins with, for the loop's calibration.
        repeat: whether a replay begins again at its end.
        origins: web pages that may connect to a WebSocket.
        model: file of the pose model of cameras and films; ``None`` for the default place.
        how: what a person says about the recording of a replay.

    Raises:
        OptionError: no such kind of source, a port that is none, or something is said about a source that is no
            recording.
        MotionError: a recording that cannot be replayed for this body.
    """
    kind, _, rest = spec.partition(":")
    if kind in SOURCES and kind != "replay" and how.said:
        raise OptionError(
            f"{', '.join(how.said)} said of {spec!r}: only recordings need that; play one with replay:FILE, or leave "
            "it out"
        )
    if kind == "replay":
        clips = _clips(rest or "embedded", body, actions, how)
        return ReplaySource(clips, speed=speed, repeat=repeat, stand=_STAND * calibration)
    if kind == "udp":
        host, port = host_and_port(rest, 9870)
        return UdpSource(body, host, port, token)
    if kind == "ws":
        host, port = host_and_port(rest, 9871)
        return WebSocketSource(body, host, port, token, origins)
    if kind == "camera":
        if rest and not (rest.isascii() and rest.isdigit()):
            raise OptionError(f"expected camera or camera:NUMBER such as camera:0, got {spec!r}")
        return CameraSource(body, int(rest or 0), model=model)
    if kind == "film":
        if not rest:
            raise OptionError("expected film:FILE such as film:wave.mp4")
        return FilmSource(body, rest, speed=speed, repeat=repeat, stand=_STAND * calibration, model=model)
    raise OptionError(f"unknown source {spec!r}; {nearest_name(kind, SOURCES)}")


def make_sink(
    specs: Sequence[str],
    robot: Robot,
    *,
    token: str | None = None,
    rate: float = 30.0,
    operator: Embodiment | None = None,
) -> Sink:
    """One sink, or several at once, from their addresses.

    Args:
        specs: see ``SINKS``.
        robot: whose joints.
        token: secret that goes with UDP packets.
        rate: of a simulated robot [Hz].
        operator: who is shown beside a simulated robot, see ``BulletSink.accompany``.

    Raises:
        OptionError: no such kind of sink.
    """
    sinks = [_sink(spec, robot, token, rate, operator) for spec in specs]
    return sinks[0] if len(sinks) == 1 else ManySinks(sinks)


def read_token(path: str | os.PathLike[str] | None) -> str | None:
    """The secret in a file, without surrounding blanks; ``None`` without a file.

    A file rather than an option, because other users of a machine can read command lines.

    Raises:
        TeleoperationError: the file cannot be read or is empty.
    """
    if path is None:
        return None
    try:
        token = Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise TeleoperationError(f"cannot read the token file {path}: {error}") from error
    if not token:
        raise TeleoperationError(f"the token file {path} is empty; write a secret of at least 8 characters into it")
    return token


def host_and_port(text: str, default: int) -> tuple[str, int]:
    """``""``, ``PORT``, ``HOST:PORT`` or ``[IPv6]:PORT``.

    Raises:
        OptionError: something else.
    """
    host, _, port = text.rpartition(":")
    if not port:
        port = str(default)
    if not port.isascii() or not port.isdigit():
        raise OptionError(f"expected HOST:PORT or PORT such as 127.0.0.1:{default}, got {text!r}")
    return host.strip("[]") or "127.0.0.1", int(port)


def _sink(spec: str, robot: Robot, token: str | None, rate: float, operator: Embodiment | None) -> Sink:
    from syda_gym.teleoperation.outgoing.bullet import BulletSink

    kind, _, rest = spec.partition(":")
    if kind == "none":
        return MemorySink(limit=1)
    if kind in ("bullet", "window"):
        return BulletSink(robot, operator=operator, window=kind == "window", rate=rate)
    if kind == "video":
        return BulletSink(robot, operator=operator, video=rest or "teleoperation.mp4", rate=rate)
    if kind == "udp":
        host, port = host_and_port(rest, 9880)
        return UdpSink(robot, host, port, token)
    if kind == "naoqi":
        from syda_gym.teleoperation.outgoing.naoqi import NaoqiSink

        return NaoqiSink(robot, rest or "tcp://127.0.0.1:9559")
    raise OptionError(f"unknown sink {spec!r}; {nearest_name(kind, SINKS)}")


def _clips(spec: str, body: Embodiment, actions: Sequence[str], how: HowToRead) -> list[MotionClip]:
    motions = how.load(spec)
    # A recording of somebody is replayed by whoever has the same joints; the calibration takes care of the size.
    names = [name for name, other in motions.bodies.items() if _fits(other, body)]
    if not names:
        raise MotionError(
            f"{motions.name} holds {', '.join(motions.bodies)}, none with the features of {body.name!r}; replay a "
            "recording of such a body"
        )
    clips = [clip for clip in motions.clips(body.name if body.name in names else names[0]) if not clip.mirrored]
    if actions:
        known = {clip.action for clip in clips}
        for action in actions:
            if action not in known:
                raise OptionError(f"no action {action!r} in {motions.name}; {nearest_name(action, known)}")
        clips = [clip for clip in clips if clip.action in actions]
    return clips


def _fits(other: Embodiment, body: Embodiment) -> bool:
    same_kind = isinstance(other, HumanSkeleton) == isinstance(body, HumanSkeleton)
    return same_kind and [f.name for f in other.features] == [f.name for f in body.features]
