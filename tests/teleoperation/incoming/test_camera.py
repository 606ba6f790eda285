"""Cameras and films as sources, with made-up devices; and one real film through the real model."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import MotionError, OptionError, TeleoperationError
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions.film.pictures import Shot
from syda_gym.motions.film.pose_model import Picture, Pose
from syda_gym.teleoperation import LoopSettings, MemorySink, TeleoperationLoop, run
from syda_gym.teleoperation.addresses import make_source
from syda_gym.teleoperation.incoming.camera import CameraSource, FilmSource
from syda_gym.teleoperation.incoming.inbox import Received

ADULT = catalog.get("adult")


class Device:
    """A camera that gives a picture every ``period`` seconds until ``pull`` is set."""

    def __init__(self, period: float = 0.01) -> None:
        self.period = period
        self.pull = threading.Event()
        self.opened = 0
        self.closed = 0
        self._count = 0

    def open(self) -> Device:
        if self.pull.is_set():
            raise MotionError("no picture from camera 0")
        self.opened += 1
        return self

    def read(self) -> Shot | None:
        time.sleep(self.period)
        if self.pull.is_set():
            return None
        self._count += 1
        return Shot(np.full((4, 4, 3), self._count % 256, np.uint8), None)

    def close(self) -> None:
        self.closed += 1


def standing_person(picture: Picture, when: float) -> Pose:
    world = np.zeros((33, 3))
    for side, x in ((0, 0.18), (1, -0.18)):
        world[11 + side], world[13 + side], world[15 + side] = (x, -0.45, 0.0), (x, -0.16, 0.0), (x, 0.1, 0.0)
    return Pose(world, np.full((33, 2), 0.5), np.ones(33))


def nobody(picture: Picture, when: float) -> None:
    return None


def wait_until(true: Callable[[], bool], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def frames(source: CameraSource, count: int) -> list[Received]:
    found: list[Received] = []
    end = time.monotonic() + 5.0
    while len(found) < count and time.monotonic() < end:
        received = source.take(0.1)
        if received.packet is not None:
            found.append(received)
    return found


class TestCamera:
    def test_a_person_before_a_camera_becomes_frames_in_the_recordings_axes(self) -> None:
        device = Device()
        with CameraSource(ADULT, open_pictures=device.open, see=standing_person) as source:
            received = frames(source, 2)
        frame = received[0].packet.frame.reshape(6, 3)
        np.testing.assert_allclose(frame[0], [-0.18, 0.45, 0.0])  # left shoulder: to the subject's left, up
        assert received[0].packet.tracking == 1.0
        assert received[1].packet.sequence > received[0].packet.sequence
        assert received[1].packet.sent > received[0].packet.sent

    def test_the_newest_picture_wins_where_the_model_is_slower_than_the_camera(self) -> None:
        device, looked = Device(period=0.005), []

        def slow(picture: Picture, when: float) -> Pose:
            looked.append(int(picture[0, 0, 0]))
            time.sleep(0.05)
            return standing_person(picture, when)

        with CameraSource(ADULT, open_pictures=device.open, see=slow) as source:
            frames(source, 4)
        assert source.inbox.dropped["picture: overtaken"] > 8
        assert max(np.diff(looked)) > 3, "pictures in between were left out"

    def test_an_unplugged_camera_is_waited_for_and_found_again(self) -> None:
        device = Device()
        with CameraSource(ADULT, open_pictures=device.open, see=standing_person) as source:
            assert frames(source, 1)
            device.pull.set()
            wait_until(lambda: device.closed == 1)
            source.take(0.0)
            assert source.take(0.2).packet is None, "no frame while the camera is gone"
            assert not source.inbox.closed
            device.pull.clear()
            assert frames(source, 2)
        assert source.lost == 1
        assert device.opened == 2
        assert source.inbox.dropped["camera: gone"] == 1

    def test_somebody_who_leaves_leaves_no_frames(self) -> None:
        with CameraSource(ADULT, open_pictures=Device().open, see=nobody) as source:
            wait_until(lambda: source.inbox.dropped["picture: no person"] > 2)
            assert source.take(0.0).packet is None
            assert source.look is not None, "the picture is shown all the same"
            assert source.look.pose is None

    def test_a_model_that_fails_is_counted_and_does_not_end_the_thread(self) -> None:
        def broken(picture: Picture, when: float) -> Pose:
            raise RuntimeError("graph")

        with CameraSource(ADULT, open_pictures=Device().open, see=broken) as source:
            wait_until(lambda: source.inbox.dropped["pose model: RuntimeError"] > 2)

    def test_the_time_from_picture_to_frame_is_told_by_part(self) -> None:
        def slow(picture: Picture, when: float) -> Pose:
            time.sleep(0.02)
            return standing_person(picture, when)

        with CameraSource(ADULT, open_pictures=Device().open, see=slow) as source:
            frames(source, 5)
            parts = source.parts()
        assert parts["pose_p50_ms"] >= 20.0
        assert parts["wait_p50_ms"] >= 0.0
        assert parts["picture_to_frame_p50_ms"] >= parts["pose_p50_ms"]

    def test_without_a_camera_there_is_one_error_that_says_what_else_would_do(self, pose_model: Path) -> None:
        with pytest.raises(TeleoperationError, match=r"no picture from camera 63.*film:FILE\.mp4"):
            CameraSource(ADULT, 63).start()

    def test_only_people_stand_before_cameras(self) -> None:
        with pytest.raises(OptionError, match="a camera sees people"):
            CameraSource(catalog.get("pepper"))

    @pytest.mark.parametrize(("spec", "words"), [("camera:x", "camera:NUMBER"), ("film:", "film:FILE")])
    def test_addresses_that_are_none_are_refused(self, spec: str, words: str) -> None:
        with pytest.raises(OptionError, match=words):
            make_source(spec, ADULT)


class TestHolding:
    def test_the_robot_holds_when_the_person_leaves_and_follows_again(self) -> None:
        """A raised arm, then nobody, then the arm again: following, holding, following."""
        here = threading.Event()
        here.set()

        def see(picture: Picture, when: float) -> Pose | None:
            if not here.is_set():
                return None
            pose = standing_person(picture, when)
            pose.world[15] = (0.6, -0.4, 0.0)
            return pose

        loop = TeleoperationLoop(unfitted(ADULT, catalog.get("pepper")), LoopSettings(calibration=0.0))
        sink = MemorySink()

        def watch(decision: object) -> None:
            states = [d.state.value for d in sink.decisions]
            if states.count("following") == 10:
                here.clear()
            if states.count("holding") >= 5:
                here.set()

        with CameraSource(ADULT, open_pictures=Device(0.02).open, see=see) as source:
            run(source, loop, sink, seconds=2.5, on_decision=watch, rest_at_end=False)
        states = [d.state.value for d in sink.decisions]
        first = states.index("holding", states.index("following"))
        assert "following" in states[first:], "it follows again"


class TestFilm:
    def test_a_film_drives_simulated_commands(self, person_film: Path, pose_model: Path) -> None:
        loop = TeleoperationLoop(unfitted(ADULT, catalog.get("pepper")), LoopSettings(calibration=0.5))
        sink = MemorySink()
        with FilmSource(ADULT, person_film, speed=0.4, stand=0.7) as source:  # slow: other work may share the machine
            statistics = run(source, loop, sink, rest_at_end=False)
        assert loop.calibration is not None, loop.calibration_message
        assert statistics.states["following"] > 15
        commands = np.array([d.command for d in sink.decisions])
        assert np.ptp(commands, axis=0).max() > 0.2, "the robot moves"
        assert source.parts()["looked_at"] > 10

    def test_a_film_without_a_person_is_one_clear_error(self, tmp_path: Path, pose_model: Path) -> None:
        from syda_gym.simulation.pictures.video import write_video

        film = write_video(tmp_path / "black.mp4", (np.zeros((64, 64, 3), np.uint8) for _ in range(20)), 15.0)
        source = FilmSource(ADULT, film, stand=1.0)
        with pytest.raises(TeleoperationError, match="no person was found in the first"):
            source.start()
        assert source._owned is not None
        assert source._owned._landmarker is None, "the model is freed, or MediaPipe complains when Python ends"

    def test_no_film_is_one_clear_error(self, tmp_path: Path, pose_model: Path) -> None:
        with pytest.raises(TeleoperationError, match="no film"):
            FilmSource(ADULT, tmp_path / "absent.mp4").start()

    def test_no_model_is_one_clear_error(self, person_film: Path, tmp_path: Path) -> None:
        with pytest.raises(TeleoperationError, match="no pose model"):
            FilmSource(ADULT, person_film, model=tmp_path / "absent.task").start()
