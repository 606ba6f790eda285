"""Sinks: where commands go: UDP as JSON, several sinks at once, or a list for tests."""

from __future__ import annotations

import contextlib
import json
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.teleoperation.incoming.network import require_token
from syda_gym.teleoperation.tick import Decision

__all__ = ["ManySinks", "MemorySink", "Sink", "UdpSink"]

_GONE = 15  # packets in a row that could not be sent


class Sink(ABC):
    """Takes decisions; ``send`` returns at once, whatever the network or robot does."""

    def open(self) -> None:  # noqa: B027 - not every sink has something to open
        """Prepares for commands.

        Raises:
            TeleoperationError: the robot or address cannot be reached.
        """

    @abstractmethod
    def send(self, decision: Decision) -> None:
        """Sends one command."""

    def angles(self) -> FloatArray | None:
        """The robot's joint angles now ``(n,)`` [rad]; ``None`` from a sink that cannot tell.

        Raises:
            TeleoperationError: the robot should tell and does not.
        """
        return None

    def news(self) -> list[str]:
        """What a person should know and has not been told yet, such as a film that could not be written."""
        return []

    def rehearse(self) -> None:  # noqa: B027 - most sinks only hand over
        """Does what ``send`` does short of sending, so that the next command goes out faster."""

    def stop(self) -> None:  # noqa: B027 - a sink without motors has nothing to stop
        """Emergency stop: the robot must stand still now, whatever is queued."""

    def close(self) -> None:  # noqa: B027
        """Frees what ``open`` took; harmless when repeated."""

    def __enter__(self) -> Sink:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class MemorySink(Sink):
    """Keeps the latest decisions, for tests and measurements.

    Args:
        limit: how many are kept.
    """

    def __init__(self, limit: int = 100_000) -> None:
        self.decisions: deque[Decision] = deque(maxlen=limit)

    def send(self, decision: Decision) -> None:
        """Keeps the decision."""
        self.decisions.append(decision)


class ManySinks(Sink):
    """Sends to several sinks in turn; one that fails is left out with a line, and the others go on.

    Args:
        sinks: all for the same robot.

    Attributes:
        lost: sinks that failed.
    """

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self.sinks = tuple(sinks)
        self.lost: tuple[Sink, ...] = ()
        self._news: list[str] = []

    def open(self) -> None:
        """Opens all, or none."""
        opened: list[Sink] = []
        try:
            for sink in self.sinks:
                sink.open()
                opened.append(sink)
        except BaseException:
            for sink in opened:
                sink.close()
            raise

    def send(self, decision: Decision) -> None:
        """Sends to each.

        Raises:
            TeleoperationError: the last of them failed.
        """
        failed: list[tuple[Sink, Exception]] = []
        for sink in self.sinks:
            try:
                sink.send(decision)
            except Exception as error:  # the others must be commanded all the same
                failed.append((sink, error))
        for sink, reason in failed:
            self._lose(sink, reason)

    def angles(self) -> FloatArray | None:
        """Where the robot is by the first sink that can tell.

        Raises:
            TeleoperationError: those that should tell do not.
        """
        errors = []
        for sink in self.sinks:
            try:
                angles = sink.angles()
            except Exception as error:
                errors.append(error)
                continue
            if angles is not None:
                return angles
        if errors:
            raise errors[0]
        return None

    def news(self) -> list[str]:
        """The news of each, and which of them failed."""
        news, self._news = self._news, []
        for sink in self.sinks:
            news += sink.news()
        return news

    def rehearse(self) -> None:
        """Rehearses with each."""
        for sink in self.sinks:
            sink.rehearse()

    def stop(self) -> None:
        """Stops each, those that failed too, even if one fails."""
        errors = []
        for sink in (*self.sinks, *self.lost):
            try:
                sink.stop()
            except Exception as error:  # the others must stop all the same
                errors.append(error)
        if errors:
            raise errors[0]

    def close(self) -> None:
        """Closes each, even if one fails."""
        errors = []
        for sink in (*self.sinks, *self.lost):
            try:
                sink.close()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]

    def _lose(self, sink: Sink, error: Exception) -> None:
        if len(self.sinks) == 1:
            raise TeleoperationError(f"no sink takes commands any more: {error}") from error
        self.sinks = tuple(one for one in self.sinks if one is not sink)
        self.lost = (*self.lost, sink)
        self._news.append(f"{type(sink).__name__} GONE: {error}; the others go on")
        with contextlib.suppress(Exception):  # it may hear a stop, if nothing else
            sink.stop()


class UdpSink(Sink):
    """Sends joint commands as JSON packets over UDP.

    A packet holds ``v`` (1), ``seq``, ``t`` (the loop's seconds), ``robot``, ``state`` (as in ``State``), ``joints``
    (name to angle [rad]) and ``token`` if one was given. A receiver should ignore packets whose ``seq`` is not greater
    than the last, hold on ``stopped``, and hold by itself when packets cease.

    Args:
        robot: whose joints.
        host: where to; anything but loopback needs a token.
        port: port there.
        token: secret that goes with every packet.

    Raises:
        OptionError: an address beyond loopback without a token, or a port that is none.
    """

    def __init__(self, robot: Robot, host: str = "127.0.0.1", port: int = 9880, token: str | None = None) -> None:
        require_token(host, token)
        if not 1 <= port <= 65535:
            raise OptionError(f"port must be between 1 and 65535, got {port}")
        self.robot = robot
        self.host = host
        self.port = port
        self.unsent = 0
        self._failed = 0
        self._news: list[str] = []
        self._template = _template(robot, token)
        self._sequence = 0
        self._latest: Decision | None = None
        self._socket: socket.socket | None = None
        self._address: Any = None

    def open(self) -> None:
        """Resolves the address.

        Raises:
            TeleoperationError: it cannot be resolved.
        """
        try:
            found = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise TeleoperationError(
                f"cannot send to udp {self.host}:{self.port}: {error}; check the address"
            ) from error
        family, kind, protocol, _, self._address = found
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)

    def send(self, decision: Decision) -> None:
        """Sends the command; a full or unreachable network costs the packet, not the loop's time."""
        if self._socket is None:
            raise TeleoperationError("this UDP sink is not open; call open() first")
        data = self._packet(decision)
        self._sequence += 1
        self._latest = decision
        try:
            self._socket.sendto(data, self._address)
            self._failed = 0
        except OSError as error:
            self.unsent += 1
            self._failed += 1
            if self._failed == _GONE:
                self._news.append(f"nothing gets through to udp {self.host}:{self.port}: {error.strerror or error}")

    def news(self) -> list[str]:
        """Whether packets stopped getting out."""
        news, self._news = self._news, []
        return news

    def rehearse(self) -> None:
        """Writes the last packet again and keeps it."""
        if self._latest is not None:
            self._packet(self._latest)

    def _packet(self, decision: Decision) -> bytes:
        values = (self._sequence, float(decision.now), decision.state.value, *decision.command.tolist())
        return (self._template % values).encode()

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _template(robot: Robot, token: str | None) -> str:
    """A packet with gaps for sequence, time, state and angles: ``repr`` of a finite float is its JSON, bit for bit."""

    def quoted(text: str) -> str:
        return json.dumps(text).replace("%", "%%")

    joints = ",".join(f"{quoted(name)}:%r" for name in robot.joint_names)
    secret = "" if token is None else f',"token":{quoted(token)}'
    robot_name = quoted(robot.name)
    return f'{{"v":1,"seq":%d,"t":%r,"robot":{robot_name},"state":"%s","joints":{{{joints}}}{secret}}}'
