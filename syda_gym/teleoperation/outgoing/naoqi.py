"""NaoqiSink: Pepper and NAO through NAOqi's ALMotion, by the ``qi`` package."""

from __future__ import annotations

import socket
import threading
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MissingExtraError, OptionError, TeleoperationError
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.tick import Decision, State

__all__ = ["NaoqiSink"]

_PORT = 9559  # NAOqi's own
_TIMEOUT = 5.0  # s; for connecting and for calls outside the loop


class NaoqiSink(Sink):
    """Sends joint commands to a robot's ``ALMotion`` service.

    A thread of its own calls ``setAngles(names, angles, fractionMaxSpeed)`` with the newest command, so that a slow
    network delays the robot but never the loop. NAOqi limits the joint speeds once more by ``speed``. Calls used:
    ``wakeUp``, ``setStiffnesses``, ``getAngles``, ``setAngles``, ``killAll`` (http://doc.aldebaran.com/2-5/naoqi/motion).

    Args:
        robot: its joint names must be NAOqi's, as those of the catalog's ``pepper`` and ``nao`` are.
        url: such as ``tcp://pepper.local:9559``.
        speed: NAOqi's fraction of the maximum speed, in (0, 1].
        wake: whether ``open`` wakes the robot up and stiffens the arms.

    Attributes:
        overtaken: commands that a newer one replaced before the robot took them.

    Raises:
        OptionError: ``speed`` is outside (0, 1].
    """

    def __init__(self, robot: Robot, url: str = "tcp://127.0.0.1:9559", speed: float = 0.8, wake: bool = True) -> None:
        if not 0.0 < speed <= 1.0:
            raise OptionError(f"NAOqi's speed fraction must be in (0, 1], got {speed}")
        self.robot = robot
        self.url = url
        self.speed = speed
        self.wake = wake
        self.overtaken = 0
        self._names = list(robot.joint_names)
        self._session: Any = None
        self._motion: Any = None
        self._thread: threading.Thread | None = None
        self._condition = threading.Condition()
        self._next: list[float] | None = None
        self._ending = False
        self._stops = 0
        self._failure: Exception | None = None

    def open(self) -> None:
        """Connects, checks the joints and stiffens the arms.

        Raises:
            MissingExtraError: ``qi`` is not installed.
            TeleoperationError: no robot at the address, or a robot without these joints.
        """
        try:
            import qi
        except ImportError as error:
            raise MissingExtraError("a NAOqi robot", "naoqi") from error
        self._knock()
        session = qi.Session()
        try:
            session.connect(self.url, _async=True).value(int(_TIMEOUT * 1000))
            self._motion = session.service("ALMotion")
            if self.wake:
                self._motion.wakeUp()
                self._motion.setStiffnesses(self._names, 1.0)
            self._motion.getAngles(self._names, True)
        except RuntimeError as error:
            self._motion = None
            session.close()
            raise TeleoperationError(
                f"no NAOqi robot with the arm joints of {self.robot.name!r} at {self.url}: {error}; check address, "
                "network and that the robot is on"
            ) from error
        self._session = session
        self._thread = threading.Thread(target=self._run, name="NaoqiSink", daemon=True)
        self._thread.start()

    def angles(self) -> FloatArray:
        """The robot's joint angles now ``(n,)`` [rad], by its sensors; where the loop should start.

        Raises:
            TeleoperationError: not open.
        """
        if self._motion is None:
            raise TeleoperationError("this NAOqi sink is not open; call open() first")
        return np.array(self._motion.getAngles(self._names, True), dtype=np.float64)

    def send(self, decision: Decision) -> None:
        """Hands the command to the thread; after an emergency stop nothing is sent until it is released.

        Raises:
            TeleoperationError: an earlier call failed; the robot is gone or refuses.
        """
        if self._failure is not None:
            raise TeleoperationError(f"the robot at {self.url} does not answer any more: {self._failure}")
        if decision.state is State.STOPPED:
            return  # a command, even the last one again, would set the motors going
        with self._condition:
            if self._next is not None:
                self.overtaken += 1
            self._next = decision.command.tolist()
            self._condition.notify()

    def stop(self) -> None:
        """Kills every motion of the robot; commands queued before are dropped.

        The call is made at once, without waiting for the network, and again by the thread if a command was on its way
        meanwhile, so that the last word that the robot hears is the stop.

        Raises:
            TeleoperationError: the robot cannot be told.
        """
        with self._condition:
            self._next = None
            self._stops += 1
            self._condition.notify()
        if self._motion is None:
            return
        try:
            self._kill()
        except Exception as error:
            raise TeleoperationError(f"the robot at {self.url} does not take the stop: {error}") from error

    def _kill(self) -> None:
        self._motion.killAll(_async=True)

    def close(self) -> None:
        """Ends the thread and the connection; the arms stay stiff where they are."""
        with self._condition:
            self._ending = True
            self._condition.notify()
        if self._thread is not None:
            self._thread.join(timeout=_TIMEOUT)
            self._thread = None
        self._motion = None
        if self._session is not None:
            self._session.close()
            self._session = None

    def _knock(self) -> None:
        """Looks whether anything listens: a ``qi`` session that cannot connect may block for ever when it is freed."""
        address = urlsplit(self.url)
        try:
            if address.hostname is None:
                raise ValueError("expected tcp://HOST:PORT")
            socket.create_connection((address.hostname, address.port or _PORT), timeout=_TIMEOUT).close()
        except (OSError, ValueError) as error:
            raise TeleoperationError(
                f"no NAOqi robot at {self.url}: {error}; check address, network and that the robot is on"
            ) from error

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._next is None and not self._ending:
                    self._condition.wait()
                angles, self._next = self._next, None
                stops = self._stops
            if angles is None:
                return
            try:
                self._motion.setAngles(self._names, angles, self.speed)
                if self._stops != stops:  # a stop came while the command was on its way
                    self._kill()
            except Exception as error:  # qi raises RuntimeError for most, and others on a lost connection
                self._failure = error
                return
