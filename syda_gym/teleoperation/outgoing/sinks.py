"""Sinks: where commands go: UDP as JSON, several sinks at once, or a list for tests."""

from __future__ import annotations

import json
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.teleoperation.incoming.sources import require_token
from syda_gym.teleoperation.tick import Decision

__all__ = ["ManySinks", "MemorySink", "Sink", "UdpSink"]


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
    """Sends to several sinks in turn.

    Args:
        sinks: all for the same robot.
    """

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self.sinks = tuple(sinks)

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
        """Sends to each."""
        for sink in self.sinks:
            sink.send(decision)

    def rehearse(self) -> None:
        """Rehearses with each."""
        for sink in self.sinks:
            sink.rehearse()

    def stop(self) -> None:
        """Stops each, even if one fails."""
        errors = []
        for sink in self.sinks:
            try:
                sink.stop()
            except Exception as error:  # the others must stop all the same
                errors.append(error)
        if errors:
            raise errors[0]

    def close(self) -> None:
        """Closes each."""
        for sink in self.sinks:
            sink.close()


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
        except OSError:
            self.unsent += 1

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
