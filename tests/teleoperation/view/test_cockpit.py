"""The cockpit: buttons end in the inbox, the page shows what the loop does, and the loop never waits for it."""

from __future__ import annotations

import statistics
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import OptionError
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions import load_motions
from syda_gym.motions.film.pose_model import Pose
from syda_gym.teleoperation import LoopSettings, MemorySink, ReplaySource, State, TeleoperationLoop, run
from syda_gym.teleoperation.incoming.camera import CameraSource, Look
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.outgoing.sinks import ManySinks
from syda_gym.teleoperation.tick import CONTROLS, Decision
from syda_gym.teleoperation.view.cockpit import BUTTONS, Cockpit
from syda_gym.teleoperation.view.words import status_text

ADULT, PEPPER = catalog.get("adult"), catalog.get("pepper")


def waving() -> list[Any]:
    return [clip for clip in load_motions("embedded").clips("adult") if clip.action == "wave_high"][:1]


def made(tmp_path: Path, source: Any = None, sink: Any = None, **options: Any) -> Cockpit:
    """A cockpit whose page is not opened."""
    loop = TeleoperationLoop(unfitted(ADULT, PEPPER), LoopSettings(calibration=0.0))
    return Cockpit(
        loop, source or ReplaySource(waving()), sink or MemorySink(), LiveStatistics(), folder=tmp_path, **options
    )


def decided(state: State = State.FOLLOWING, **changes: Any) -> Decision:
    return Decision(**{"now": time.monotonic(), "state": state, "command": PEPPER.rest.copy(), **changes})


class TestButtons:
    @pytest.mark.parametrize("name", [button.name for button in BUTTONS if button.name != "record"])
    def test_every_button_is_a_request_of_the_loop(self, name: str, tmp_path: Path) -> None:
        cockpit = made(tmp_path)
        cockpit.press(name)
        assert cockpit._source.take(0.0).controls == (name,)
        assert name in CONTROLS

    def test_a_stop_pressed_on_the_page_is_obeyed_within_a_tick(self, tmp_path: Path) -> None:
        source, pressed, stops = ReplaySource(waving(), repeat=True), list[int](), list[int]()

        class Motors(MemorySink):
            def stop(self) -> None:
                stops.append(len(self.decisions))

        sink = Motors()
        loop = TeleoperationLoop(unfitted(ADULT, PEPPER), LoopSettings(calibration=0.0))
        cockpit = Cockpit(loop, source, sink, LiveStatistics(), folder=tmp_path)

        def press() -> None:  # as the page's own thread does
            while len(sink.decisions) < 20:
                time.sleep(0.005)
            pressed.append(len(sink.decisions))
            cockpit.press("stop")

        thread = threading.Thread(target=press)
        thread.start()
        with source:
            run(source, loop, sink, seconds=2.0)
        thread.join()
        states = [decision.state for decision in sink.decisions]
        first = states.index(State.STOPPED)
        assert first <= pressed[0] + 1, "one command may have been on its way"
        assert stops[0] <= first, "the robot's own stop comes first"
        assert set(states[first:]) == {State.STOPPED}
        assert all(
            (decision.command == sink.decisions[first - 1].command).all()
            for decision in sink.decisions
            if decision.state is State.STOPPED
        )

    def test_every_request_has_a_button(self) -> None:
        assert {button.name for button in BUTTONS} == {*CONTROLS, "record"}

    def test_what_is_no_button_asks_nothing(self, tmp_path: Path) -> None:
        cockpit = made(tmp_path)
        cockpit.press("rm -rf")
        assert cockpit._source.take(0.0).controls == ()


class TestPage:
    def test_before_the_first_decision_there_is_nothing_to_show(self, tmp_path: Path) -> None:
        assert made(tmp_path).look() is None

    def test_robot_ghost_operator_and_plots_are_shown(self, tmp_path: Path) -> None:
        cockpit = made(tmp_path)
        command = PEPPER.rest + 0.1
        cockpit.update(decided(command=command))
        message = cockpit.look()
        assert message is not None
        np.testing.assert_allclose(message["poses"]["robot"], command, atol=1e-4)
        assert len(message["poses"]["ghost"]) == PEPPER.n_features
        assert len(message["poses"]["operator"]) == ADULT.n_features
        assert [len(values) for values in message["values"]] == [1, 2, 1]
        assert "following" in message["text"]

    def test_a_simulated_robot_is_shown_where_it_is_and_not_where_it_should_be(self, tmp_path: Path) -> None:
        class Simulated(MemorySink):
            def angles(self) -> Any:
                return PEPPER.rest + 0.2

        cockpit = made(tmp_path, sink=ManySinks([MemorySink(), Simulated()]))
        cockpit.update(decided())
        message = cockpit.look()
        assert message is not None
        np.testing.assert_allclose(message["poses"]["robot"], PEPPER.rest + 0.2, atol=1e-4)

    def test_a_reason_stays_long_enough_to_be_read(self, tmp_path: Path) -> None:
        now = [100.0]
        cockpit = made(tmp_path, clock=lambda: now[0])
        cockpit.update(decided(now=100.0, reasons=("self-collision: held back",)))
        cockpit.update(decided(now=100.03))
        for when, said in ((100.5, True), (102.0, False)):
            now[0] = when
            message = cockpit.look()
            assert message is not None
            assert ("self-collision" in message["text"]) == said

    def test_the_camera_picture_comes_with_its_landmarks_and_once_only(self, tmp_path: Path) -> None:
        pytest.importorskip("cv2")
        source = CameraSource(ADULT, see=lambda picture, when: None)
        cockpit = made(tmp_path, source=source)
        cockpit.update(decided())
        source.look = Look(
            np.zeros((48, 64, 3), np.uint8), Pose(np.zeros((33, 3)), np.full((33, 2), 0.5), np.ones(33)), 1
        )
        message = cockpit.look()
        assert message is not None
        assert len(message["picture"]["dots"]) == 33
        assert message["picture"]["lines"]
        again = cockpit.look()
        assert again is not None
        assert "picture" not in again

    def test_names_from_files_cannot_write_the_page(self, tmp_path: Path) -> None:
        cockpit = made(tmp_path)
        decision = decided(reasons=("mapping: <img src=x> [link](http://evil)",))
        loop, source, stats = cockpit._loop, cockpit._source, cockpit._stats
        text = status_text(loop, source, stats, decision, decision.reasons, "")
        assert "<" not in text
        assert "[" not in text
        route = decided(reasons=("mapping: adult > pepper",))
        assert "adult to pepper" in status_text(loop, source, stats, route, route.reasons, "")

    def test_beyond_this_machine_a_token_is_asked_for(self, tmp_path: Path) -> None:
        with pytest.raises(OptionError, match="token"):
            made(tmp_path, host="0.0.0.0")


class TestRecording:
    def test_what_operator_and_robot_did_becomes_a_file_that_can_be_replayed(self, tmp_path: Path) -> None:
        with ReplaySource(waving(), speed=4.0) as source:
            cockpit = made(tmp_path, source=source)
            cockpit.press("record")
            run(source, cockpit._loop, MemorySink(), on_decision=cockpit.update, rest_at_end=False)
        cockpit.press("record")
        assert cockpit.recorder.path is not None, cockpit.recorder.message
        motions = load_motions(cockpit.recorder.path)
        assert set(motions.bodies) == {"adult", "pepper"}
        assert np.ptp(motions.clips("pepper")[0].frames, axis=0).max() > 0.1
        ReplaySource(motions.clips("adult"))

    def test_an_empty_recording_says_so_and_writes_nothing(self, tmp_path: Path) -> None:
        cockpit = made(tmp_path)
        cockpit.press("record")
        cockpit.press("record")
        assert "nothing recorded" in cockpit.recorder.message
        assert not list(tmp_path.iterdir())


def test_the_view_adds_less_than_a_fifth_of_a_millisecond_to_a_tick(tmp_path: Path) -> None:
    """What the loop's thread does for the view, in processor time; the page works in other threads and processes."""
    cockpit = made(tmp_path)
    cockpit.recorder.toggle()
    times = []
    for _ in range(500):
        decision = decided(reasons=("unfamiliar: slowed",), frame_used=True)
        begun = time.thread_time()
        cockpit.update(decision)
        times.append(time.thread_time() - begun)
    assert statistics.mean(times) < 0.2e-3
