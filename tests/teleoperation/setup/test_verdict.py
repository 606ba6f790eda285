"""What `robot add` says about a robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError
from syda_gym.teleoperation.setup.robot_setup import add_robot
from syda_gym.teleoperation.setup.verdict import judge_robot

CASES = Path(__file__).parents[2] / "embodiments" / "discovery" / "cases"


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))


def test_a_sound_robot_is_good() -> None:
    verdict = judge_robot(Robot(discover(CASES / "control.urdf")))
    assert verdict.word == "good"
    assert np.degrees(verdict.error) < 1.0
    assert verdict.reason == ""


def test_an_elbow_at_the_shoulder_is_doubtful_and_told() -> None:
    description = discover(CASES / "elbow_last.urdf")
    arms = tuple(
        replace(arm, shoulder=f"{arm.side}_shoulder_pitch_link", elbow=f"{arm.side}_shoulder_roll_link",
                wrist=f"{arm.side}_forearm_link", offsets={})
        for arm in description.arms
    )  # fmt: skip
    verdict = judge_robot(Robot(replace(description, arms=arms)))
    assert verdict.word == "doubtful"
    assert "the elbow lies at the shoulder's 'left_shoulder_roll_link'; name a link beyond the wrist" in verdict.reason


def test_points_off_their_links_survive_the_yaml() -> None:
    added = add_robot(CASES / "elbow_frame_slid.urdf", "slid")
    again = Robot.read(added.description)
    assert again == added.robot
    assert again.description.arms[0].offsets["elbow"] == (0.0, -0.03, 0.0)


def test_a_description_written_by_hand_is_added_as_it_is(tmp_path: Path) -> None:
    text = add_robot(CASES / "elbow_last.urdf", "found").description.read_text()
    path = tmp_path / "hand.yaml"
    path.write_text(text.replace("-0.255", "-0.2"))
    added = add_robot(path, "by-hand")
    np.testing.assert_allclose(added.robot.arm_lengths[:, 1], 0.2)


def test_nonsense_in_a_description_is_refused_with_its_line(tmp_path: Path) -> None:
    text = add_robot(CASES / "control.urdf", "nonsense").description.read_text()
    path = tmp_path / "hand.yaml"
    path.write_text(text.replace("elbow: left_elbow_link", "elbow: left_elbow_lin"))
    line = next(
        n
        for n, row in enumerate(path.read_text().splitlines(), 1)
        if "left_elbow_lin," in row or row.endswith("left_elbow_lin")
    )
    with pytest.raises(EmbodimentError, match=rf"line {line}: .*did you mean 'left_elbow_link'"):
        Robot.read(path)
