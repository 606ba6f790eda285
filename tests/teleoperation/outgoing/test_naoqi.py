"""The NAOqi sink against an ALMotion service that runs right here."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.teleoperation.outgoing.naoqi import NaoqiSink
from syda_gym.teleoperation.tick import Decision, State

qi = pytest.importorskip("qi", reason="SKIPPED LOUDLY: the NAOqi sink needs pip install 'syda-gym[naoqi]'")

PATIENCE = 60.0  # s; how long a test waits for what must come, on however busy a machine


class ALMotion:
    """The calls of NAOqi's motion service that the sink uses, with a robot that is as fast as it is told."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.angles = dict.fromkeys(names, 0.1)
        self.calls: list[tuple[Any, ...]] = []
        self.free = threading.Event()  # calls of setAngles wait while it is not set
        self.free.set()
        self.lock = threading.Lock()

    def wakeUp(self) -> None:  # noqa: N802 - NAOqi's names
        self.calls.append(("wakeUp",))

    def setStiffnesses(self, names: list[str], value: float) -> None:  # noqa: N802
        self.calls.append(("setStiffnesses", tuple(names), value))

    def getAngles(self, names: list[str], use_sensors: bool) -> list[float]:  # noqa: N802
        return [self.angles[name] for name in names]

    def setAngles(self, names: list[str], angles: list[float], fraction: float) -> None:  # noqa: N802
        assert self.free.wait(PATIENCE)
        with self.lock:
            self.angles.update(zip(names, angles, strict=True))
            self.calls.append(("setAngles", tuple(angles), fraction))

    def killAll(self) -> None:  # noqa: N802
        self.calls.append(("killAll",))


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[str, ALMotion]]:
    from syda_gym.embodiments import catalog

    robot = catalog.get("pepper")
    assert isinstance(robot, Robot)
    motion = ALMotion(robot.joint_names)
    server = qi.Session()
    server.listenStandalone("tcp://127.0.0.1:0")
    server.registerService("ALMotion", motion)
    yield server.endpoints()[0], motion
    server.close()


def decision(command: np.ndarray) -> Decision:
    return Decision(0.0, State.FOLLOWING, command)


def wait(condition: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_commands_reach_the_robot_newest_first(served: tuple[str, ALMotion], pepper: Robot) -> None:
    url, motion = served
    motion.calls.clear()
    with NaoqiSink(pepper, url, speed=0.5) as sink:
        assert isinstance(sink, NaoqiSink)
        assert motion.calls[:2] == [("wakeUp",), ("setStiffnesses", pepper.joint_names, 1.0)]
        assert sink.angles() == pytest.approx(np.full(10, 0.1)), "where the loop should start"
        motion.free.clear()  # a network that hangs
        for index in range(50):
            sink.send(decision(pepper.rest + 0.001 * index))
        assert sink.overtaken >= 48, "the loop never waits for the robot"
        motion.free.set()
        wait(lambda: np.allclose(list(motion.angles.values()), pepper.rest + 0.049))
        assert {call[2] for call in motion.calls if call[0] == "setAngles"} == {0.5}
        sink.stop()  # asks without waiting for the network, and the thread asks again
        wait(lambda: ("killAll",) in motion.calls)
        time.sleep(0.2)
        count = len(motion.calls)
        sink.send(Decision(0.0, State.STOPPED, pepper.rest))
        time.sleep(0.1)
        assert len(motion.calls) == count, "nothing sets the motors going after an emergency stop"


def test_no_robot_and_bad_settings_are_named(pepper: Robot) -> None:
    for url in ("tcp://127.0.0.1:1", "tcp://", "tcp://127.0.0.1:port"):
        with pytest.raises(TeleoperationError, match="no NAOqi robot"):
            NaoqiSink(pepper, url).open()
    with pytest.raises(OptionError, match="speed fraction"):
        NaoqiSink(pepper, speed=0.0)
    with pytest.raises(TeleoperationError, match="not open"):
        NaoqiSink(pepper).angles()


def test_a_robot_without_these_joints_is_refused(served: tuple[str, ALMotion]) -> None:
    from syda_gym.embodiments.robot import Robot as AnyRobot
    from syda_gym.embodiments.robot import select_sides

    url, motion = served
    from syda_gym.embodiments import catalog

    whole = catalog.get("pepper")
    assert isinstance(whole, AnyRobot)
    left = AnyRobot(select_sides(whole, ("left",)))
    missing = motion.angles.pop("LElbowYaw")
    with pytest.raises(TeleoperationError, match="arm joints of 'pepper-left'"):
        NaoqiSink(left, url).open()
    motion.angles["LElbowYaw"] = missing


def test_a_robot_that_goes_away_is_reported(pepper: Robot) -> None:
    motion = ALMotion(pepper.joint_names)
    server = qi.Session()
    server.listenStandalone("tcp://127.0.0.1:0")
    server.registerService("ALMotion", motion)
    sink = NaoqiSink(pepper, server.endpoints()[0])
    sink.open()
    sink.send(decision(pepper.rest))
    wait(lambda: any(call[0] == "setAngles" for call in motion.calls))
    server.close()

    def gone() -> bool:
        try:
            sink.send(decision(pepper.rest))
        except TeleoperationError as error:
            return "does not answer" in str(error)
        return False

    wait(gone)
    sink.close()
