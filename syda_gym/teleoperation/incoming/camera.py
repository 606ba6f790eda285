"""Camera and film sources: the person in the newest picture becomes a frame, in a thread of its own."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import KINECT_AXES, HumanSkeleton
from syda_gym.errors import MotionError, OptionError, TeleoperationError
from syda_gym.motions.film.landmarks import HiddenJoints, arm_frame
from syda_gym.motions.film.pictures import CameraPictures, FilmPictures, Pictures
from syda_gym.motions.film.pose_model import Picture, Pose, PoseModel
from syda_gym.teleoperation.incoming.packets import Packet
from syda_gym.teleoperation.incoming.sources import Source

__all__ = ["CameraSource", "FilmSource", "Look", "PictureSource"]

_AGAIN = 0.5  # s between two attempts to find a camera that is gone
_PATIENCE = 0.2  # s; how often a waiting thread looks whether it should end
_KEPT = 4096  # pictures whose times are kept
_STAND_RATE = 30.0  # Hz
_PROBED, _ENOUGH, _PROBED_SECONDS = 24, 8, 60.0  # pictures of a film that are looked at before it starts


class Look(NamedTuple):
    """One picture with what was seen in it, for whoever shows it."""

    picture: Picture
    pose: Pose | None
    number: int


class PictureSource(Source):
    """What camera and film share: one thread takes pictures, another one looks at the newest.

    Args:
        body: whose frames the mapping takes; a human.
        see: from a picture and its time [s] to a pose, such as ``PoseModel``; ``None`` loads ``model``.
        model: file of the pose model, see ``find_model``.
        clock: of the loop.

    Attributes:
        look: the newest picture that was looked at, or ``None``.
        lost: how often the camera was gone.

    Raises:
        OptionError: the body is no human.
    """

    def __init__(
        self,
        body: Embodiment,
        *,
        see: Callable[[Picture, float], Pose | None] | None = None,
        model: str | os.PathLike[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not isinstance(body, HumanSkeleton):
            raise OptionError(f"a camera sees people; {body.name!r} is a {body.kind}: choose --operator adult")
        super().__init__(body, clock)
        self.look: Look | None = None
        self.lost = 0
        self._human = body
        self._see = see
        self._model = model
        self._owned: PoseModel | None = None
        self._hidden = HiddenJoints()
        self._newest: tuple[Picture, float] | None = None
        self._fresh = threading.Condition()
        self._taker: threading.Thread | None = None
        self._ended = False
        self._number = 0
        self._sequence = 0
        self._times: deque[tuple[float, float, float]] = deque(maxlen=_KEPT)

    def parts(self) -> dict[str, float]:
        """Where the time from a picture to its frame goes: medians and 99th percentiles [ms], NaN before the first.

        ``wait``: until the thread that looks was free; ``pose``: the model; ``joints``: from landmarks to the inbox.
        """
        table = np.array(self._times) if self._times else np.full((1, 3), np.nan)
        names = ("wait", "pose", "joints")
        medians, worst = 1e3 * np.median(table, axis=0), 1e3 * np.percentile(table, 99, axis=0)
        return {
            **{f"{name}_p50_ms": float(value) for name, value in zip(names, medians, strict=True)},
            **{f"{name}_p99_ms": float(value) for name, value in zip(names, worst, strict=True)},
            "picture_to_frame_p50_ms": float(1e3 * np.median(table.sum(axis=1))),
            "looked_at": float(self._number),
        }

    def _open(self) -> None:
        if self._see is None:
            self._owned = PoseModel(self._model)
            self._see = self._owned

    def _begin(self) -> None:
        self._taker = threading.Thread(target=self._take_pictures, name=f"{type(self).__name__} pictures", daemon=True)
        super()._begin()
        self._taker.start()

    def _shut(self) -> None:
        self.inbox.close()
        with self._fresh:
            self._fresh.notify_all()
        if self._taker is not None:
            self._taker.join(timeout=5.0)
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        if self._owned is not None:
            self._owned.close()

    def _take_pictures(self) -> None:
        """Fills the slot of the newest picture until ``_ending``; runs in a thread."""

    def _offer(self, picture: Picture, taken: float) -> None:
        """A picture that was taken at ``taken`` [s]; it replaces one that nobody looked at yet."""
        with self._fresh:
            if self._newest is not None:
                self.inbox.drop("picture: overtaken")
            self._newest = (picture, taken)
            self._fresh.notify_all()

    def _finish(self) -> None:
        """No picture will follow."""
        with self._fresh:
            self._ended = True
            self._fresh.notify_all()

    def _run(self) -> None:
        while not self._ending.is_set():
            with self._fresh:
                if self._newest is None and self._ended:
                    break
                self._fresh.wait_for(lambda: self._newest is not None or self._ended, timeout=_PATIENCE)
                offered, self._newest = self._newest, None
            if offered is not None:
                self._look_at(*offered)
        self.inbox.close()

    def _look_at(self, picture: Picture, taken: float) -> None:
        begun = self.clock()
        assert self._see is not None  # opened by start; for the type checker
        try:
            pose = self._see(picture, taken)
        except Exception as error:  # the robot holds rather than that the thread dies unseen
            self.inbox.drop(f"pose model: {type(error).__name__}")
            pose = None
        seen = self.clock()
        self._number += 1
        if pose is None:
            self.inbox.drop("picture: no person")
        else:
            self._deliver(pose, taken)
        self._times.append((begun - taken, seen - begun, self.clock() - seen))
        self.look = Look(picture, pose, self._number)

    def _deliver(self, pose: Pose, taken: float) -> None:
        held = self._hidden(*arm_frame(pose), taken)
        if held is None:
            self.inbox.drop("picture: shoulders hidden")
            return
        frame, confidence = held
        self._put(frame, taken, confidence)

    def _put(self, frame: FloatArray, taken: float, confidence: float = 1.0) -> None:
        rows = [side for side in ("left", "right") if side in self._human.sides]
        if len(rows) == 1:
            frame = frame[:9] if rows[0] == "left" else frame[9:]
        self.inbox.put(Packet(self._sequence, taken, frame, confidence), self.clock())
        self._sequence += 1


class CameraSource(PictureSource):
    """The person in front of a camera. A camera that is unplugged is waited for.

    Args:
        body: whose frames the mapping takes; a human.
        number: of the camera, 0 for the first.
        open_pictures: opens another kind of camera; called again whenever the camera is gone.
        see: see ``PictureSource``.
        model: see ``PictureSource``.
        clock: of the loop.

    Raises:
        OptionError: the body is no human, or a number below zero.
    """

    def __init__(
        self,
        body: Embodiment,
        number: int = 0,
        *,
        open_pictures: Callable[[], Pictures] | None = None,
        see: Callable[[Picture, float], Pose | None] | None = None,
        model: str | os.PathLike[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(body, see=see, model=model, clock=clock)
        if number < 0:
            raise OptionError(f"cameras are counted from 0, got {number}")
        self.number = number
        self._open_pictures = open_pictures or (lambda: CameraPictures(number))
        self._pictures: Pictures | None = None

    def _open(self) -> None:
        try:
            self._pictures = self._open_pictures()
        except MotionError as error:
            raise TeleoperationError(str(error)) from error
        try:
            super()._open()
        except BaseException:
            self._pictures.close()
            raise

    def _take_pictures(self) -> None:
        while not self._ending.is_set():
            shot = self._pictures.read() if self._pictures is not None else None
            if shot is not None:
                self._offer(shot.picture, self.clock())
                continue
            if self._pictures is not None:
                self.lost += 1
                self.inbox.drop("camera: gone")
                self._pictures.close()
                self._pictures = None
            if self._ending.wait(_AGAIN):
                break
            try:
                self._pictures = self._open_pictures()
            except MotionError:
                continue  # still gone; the watchdog has long made the robot hold
        if self._pictures is not None:
            self._pictures.close()


class FilmSource(PictureSource):
    """The person in a film, at the film's own speed; pictures that the model is too slow for are left out.

    A film rarely begins with somebody who stands still with hanging arms. The person is therefore measured first, in
    pictures from the film's beginning, and a person of those measures stands for the calibration before the film runs.

    Args:
        body: whose frames the mapping takes; a human.
        path: of the film.
        speed: 2 plays twice as fast.
        repeat: begin again at the end.
        stand: seconds of standing before the film.
        see: see ``PictureSource``.
        model: see ``PictureSource``.
        clock: of the loop.

    Raises:
        OptionError: the body is no human, or a speed that is not positive.
    """

    def __init__(
        self,
        body: Embodiment,
        path: str | os.PathLike[str],
        *,
        speed: float = 1.0,
        repeat: bool = False,
        stand: float = 0.0,
        see: Callable[[Picture, float], Pose | None] | None = None,
        model: str | os.PathLike[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(body, see=see, model=model, clock=clock)
        if not 0.0 < speed <= 100.0:
            raise OptionError(f"a film's speed must be between 0 and 100, got {speed}")
        self.path = path
        self.speed = speed
        self.repeat = repeat
        self.stand = stand
        self._standing = np.zeros(18)

    def _open(self) -> None:
        try:
            FilmPictures(self.path).close()
            super()._open()
            if self.stand > 0.0:
                self._standing = self._measure()
        except MotionError as error:
            raise TeleoperationError(str(error)) from error

    def _take_pictures(self) -> None:
        if not self.inbox.wait_for_room():
            return
        for frame in self._stand_still():
            self._put(frame, self.clock())
            if self._ending.wait(1.0 / _STAND_RATE):
                return
        while not self._ending.is_set():
            self._play()
            if not self.repeat:
                break
        self._finish()

    def _play(self) -> None:
        film = FilmPictures(self.path)
        begun = self.clock()
        try:
            while (shot := film.read()) is not None and shot.time is not None:
                due = begun + shot.time / self.speed
                if self._ending.wait(max(0.0, due - self.clock())):
                    return
                self._offer(shot.picture, self.clock())
        finally:
            film.close()

    def _stand_still(self) -> Iterator[FloatArray]:
        for _ in range(round(self.stand * _STAND_RATE)):
            yield self._standing

    def _measure(self) -> FloatArray:
        """A frame ``(18,)`` of the film's person standing with hanging arms.

        Raises:
            MotionError: nobody is seen.
        """
        found: list[FloatArray] = []
        film = FilmPictures(self.path)
        last = film.fps * _PROBED_SECONDS if film.count == 0 else min(film.count, film.fps * _PROBED_SECONDS)
        step = max(1, int(last / _PROBED))
        assert self._see is not None  # opened before; for the type checker
        number = 0
        try:
            while len(found) < _ENOUGH and number < last and (shot := film.read()) is not None:
                pose = self._see(shot.picture, self.clock())
                if pose is not None:
                    found.append(arm_frame(pose)[0])
                number += step
                for _ in range(step - 1):
                    film.skip()
        finally:
            film.close()
        if not found:
            seconds = min(_PROBED_SECONDS, last / film.fps)
            raise MotionError(
                f"{os.fspath(self.path)}: no person was found in the first {seconds:.0f} s; film one person, "
                "arms in view"
            )
        return _standing_like(np.stack(found))


def _standing_like(points: FloatArray) -> FloatArray:
    """Somebody of the same measures, facing the same way, with hanging arms: ``(18,)`` from ``(N, 6, 3)``."""
    arms = points.reshape(-1, 2, 3, 3)
    lengths = np.median(np.linalg.norm(np.diff(arms, axis=2), axis=-1), axis=(0, 1))
    lengths = np.clip(lengths, 0.12, 0.6)  # a person who is far from the camera or cut off is measured badly
    middle = np.median(arms[:, :, 0].mean(axis=1), axis=0)
    across = np.median(arms[:, 0, 0] - arms[:, 1, 0], axis=0)
    up = KINECT_AXES[2]
    across = across - (across @ up) * up
    width = float(np.linalg.norm(across))
    across = across / width if width > 0.05 else KINECT_AXES[1]
    half = 0.5 * max(width, 0.15) * across
    drops = np.array([0.0, lengths[0], lengths.sum()])
    frame = np.stack([middle + sign * half - drops[:, None] * up for sign in (1.0, -1.0)])
    return frame.reshape(-1)
