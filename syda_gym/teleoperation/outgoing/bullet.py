"""BulletSink: a simulated robot that follows the commands, in a window, in a video or unseen."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.simulation.making import make_world
from syda_gym.simulation.rates import Rates
from syda_gym.teleoperation.outgoing.sinks import Sink
from syda_gym.teleoperation.tick import Decision, State

__all__ = ["BulletSink"]

_CATCH_UP = 0.25  # s; how much simulated time may be caught up with at once
_PICTURES = 8  # pictures that may wait for the video encoder


class BulletSink(Sink):
    """Drives a robot in PyBullet in real time, from a thread of its own.

    Args:
        robot: who follows.
        operator: who leads, shown beside the robot once ``accompany`` says where to ask for frames.
        window: show PyBullet's window; needs a display.
        video: write what would be seen to this ``.mp4``.
        rate: control steps per second; physics runs at 240 Hz or the next multiple.
        camera: settings of ``simulation.camera.CameraView`` by name.

    Attributes:
        late: control steps that could not keep real time.

    Raises:
        OptionError: a video that does not end in ``.mp4``, or a rate that is not positive.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        operator: Embodiment | None = None,
        window: bool = False,
        video: str | os.PathLike[str] | None = None,
        rate: float = 30.0,
        camera: dict[str, Any] | None = None,
    ) -> None:
        if not 1.0 <= rate <= 240.0:
            raise OptionError(f"the simulation's rate must be between 1 and 240 Hz, got {rate}")
        if video is not None and Path(video).suffix != ".mp4":
            raise OptionError(f"videos end in .mp4, got {Path(video).name!r}")
        self.robot = robot
        self.operator = operator
        self.window = window
        self.video = None if video is None else Path(video)
        self.rates = Rates(int(rate), int(rate) * max(1, round(240 / int(rate))))
        self.camera = camera or {}
        self.late = 0
        self._command = robot.rest.copy()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._eye: Any = None
        self._pictures: queue.Queue[NDArray[np.uint8] | None] = queue.Queue(_PICTURES)
        self._writer: threading.Thread | None = None
        self._failure: Exception | None = None
        self._news: list[str] = []
        self._blind = False
        self._frame: Callable[[], FloatArray | None] = lambda: None

    def accompany(self, frame: Callable[[], FloatArray | None]) -> None:
        """Shows the operator in films and in the window.

        Args:
            frame: called from the simulation's thread; the operator's newest frame ``(F,)``, or ``None``.
        """
        self._frame = frame

    def open(self) -> None:
        """Builds the world and starts to simulate.

        Raises:
            OptionError: a window without a display.
            EmbodimentError: PyBullet cannot load the robot.
        """
        from syda_gym.simulation.pictures.camera import Camera, CameraView
        from syda_gym.simulation.pictures.window import Window, has_display

        if self.window and not has_display():
            raise OptionError(
                "the sink 'window' needs a display ($DISPLAY is not set); use 'bullet' or 'video:FILE.mp4'"
            )
        view = CameraView.resolve({"operator": self.operator is not None, **self.camera})
        if self.window:
            self._eye = Window(self.robot, self.operator or self.robot, view, float(self.rates.control_hz))
        elif self.video is not None:
            self._eye = Camera(self.robot, self.operator, view)
        self._world = make_world(self.robot, self.rates)
        self._ending.clear()
        if self.video is not None and not self.window:
            self._writer = threading.Thread(target=self._write, name="BulletSink video", daemon=True)
            self._writer.start()
        self._thread = threading.Thread(target=self._run, name="BulletSink", daemon=True)
        self._thread.start()

    def angles(self) -> FloatArray:
        """Joint angles of the simulated robot ``(n,)`` [rad].

        Raises:
            TeleoperationError: not open.
        """
        if self._thread is None:
            raise TeleoperationError("this simulated robot is not open; call open() first")
        with self._lock:
            angles: FloatArray = self._world.pose[0, : self.robot.n_features].copy()
        return angles

    def send(self, decision: Decision) -> None:
        """Takes over the command; after an emergency stop none until it is released.

        Raises:
            TeleoperationError: the simulation has failed.
        """
        if self._failure is not None:
            raise TeleoperationError(f"the simulated robot failed: {self._failure}") from self._failure
        if decision.state is State.STOPPED:
            return
        self._command = decision.command  # without the lock, for the loop must not wait for physics

    def news(self) -> list[str]:
        """Whether the film failed."""
        news, self._news = self._news, []
        return news

    def stop(self) -> None:
        """Holds the pose that the simulated robot has now."""
        if self._thread is not None:
            self._command = self.angles()

    def close(self) -> None:
        """Ends the simulation and finishes the video."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join(timeout=30.0)
            self._thread = None
            self._world.close()
        if self._writer is not None:
            self._pictures.put(None)
            self._writer.join(timeout=60.0)
            self._writer = None
        if self._eye is not None:
            self._eye.close()
            self._eye = None

    def _run(self) -> None:
        due, steps, most = time.monotonic(), 1, int(_CATCH_UP / self.rates.dt)
        try:
            while not self._ending.is_set():
                command = self._command
                for _ in range(steps):
                    with self._lock:
                        self._world.advance(command[None])
                        pose = self._world.pose[0].copy()
                self._show(command, pose, steps)
                due += steps * self.rates.dt
                behind = time.monotonic() - due
                steps = 1
                if behind <= 0.0:
                    self._ending.wait(-behind)
                else:  # simulated time keeps up with real time, if need be with fewer pictures
                    self.late += 1
                    steps += min(int(behind / self.rates.dt), most)
                    due = max(due, time.monotonic() - steps * self.rates.dt)
        except Exception as error:  # told to the loop by the next send
            self._failure = error

    def _show(self, command: FloatArray, pose: FloatArray, steps: int) -> None:
        if self._eye is None or self._blind:
            return
        try:
            self._draw(command, pose, steps)
        except Exception as error:  # a closed window must not end the robot
            self._blind = True
            self._news.append(f"pictures dropped: {error}")

    def _draw(self, command: FloatArray, pose: FloatArray, steps: int) -> None:
        n = self.robot.n_features
        angles = pose[:n]
        errors = np.linalg.norm(pose[n:].reshape(-1, 3) - self.robot.landmarks(command)[0], axis=-1)
        frame = self._frame()
        if frame is None and isinstance(self.operator, HumanSkeleton):
            frame = self.operator.standing()
        if self.window:
            self._eye.show(angles, reference=command, operator=frame, errors=errors)
        else:
            picture = self._eye.picture(angles, reference=command, operator=frame, errors=errors)
            for _ in range(steps):  # so that the film lasts as long as what it shows
                self._pictures.put(picture)

    def _write(self) -> None:
        from syda_gym.simulation.pictures.video import write_video

        def pictures() -> Iterator[NDArray[np.uint8]]:
            while (picture := self._pictures.get()) is not None:
                yield picture

        if self.video is not None:
            try:
                write_video(self.video, pictures(), float(self.rates.control_hz))
            except Exception as error:  # the robot goes on without its film
                self._news.append(f"film dropped: {error}")
                while self._pictures.get() is not None:
                    pass  # the simulation must not wait for a reader that is gone
