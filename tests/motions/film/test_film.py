"""Films and pictures: the person in them, hidden joints, and what is said when something is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import MotionError
from syda_gym.motions import load_motions
from syda_gym.motions.film.landmarks import HiddenJoints, arm_frame
from syda_gym.motions.film.pictures import FilmPictures
from syda_gym.motions.film.pose_model import MODEL_VARIABLE, Pose, PoseModel, find_model

cv2 = pytest.importorskip("cv2", reason="SKIPPED LOUDLY: the extra 'camera' is not installed")


def a_pose(**hidden: float) -> Pose:
    """Somebody who faces the camera with hanging arms; visibility of landmarks by number, such as ``v15=0.1``."""
    world = np.zeros((33, 3))
    for side, x in ((0, 0.18), (1, -0.18)):  # their left is at the picture's right
        world[11 + side] = (x, -0.45, 0.0)
        world[13 + side] = (x, -0.15, 0.0)
        world[15 + side] = (x, 0.1, -0.02)
    visibility = np.ones(33)
    for name, value in hidden.items():
        visibility[int(name[1:])] = value
    return Pose(world, np.zeros((33, 2)), visibility)


def write_black_film(path: Path) -> Path:
    from syda_gym.simulation.pictures.video import write_video

    return write_video(path, (np.zeros((64, 64, 3), np.uint8) for _ in range(12)), 15.0)


class TestArmFrame:
    def test_the_left_hand_is_at_the_subjects_left_and_below_the_shoulder(self) -> None:
        points, _ = arm_frame(a_pose())
        left_shoulder, left_hand, right_hand = points[0], points[2], points[5]
        assert left_hand[0] < 0.0 < right_hand[0], "x grows to the subject's right"
        assert left_hand[1] < left_shoulder[1], "y grows upward"
        assert left_hand[2] < 0.0, "z grows backward; the hand is nearer to the camera than the shoulder"


class TestHiddenJoints:
    def test_a_hidden_hand_stays_where_it_was_seen_beside_a_shoulder_that_moves(self) -> None:
        hold = HiddenJoints()
        points, visibility = arm_frame(a_pose())
        assert hold(points, visibility, 0.0) is not None
        moved = points + np.array([0.3, 0.0, 0.0])
        moved[2] = 99.0
        _, hidden = arm_frame(a_pose(v15=0.1))
        result = hold(moved, hidden, 0.1)
        assert result is not None
        frame, _ = result
        np.testing.assert_allclose(frame[6:9], points[2] + [0.3, 0.0, 0.0])
        np.testing.assert_allclose(frame[9:], moved[3:].reshape(-1))

    def test_confidence_falls_to_zero_within_the_patience_where_both_arms_are_hidden(self) -> None:
        hold = HiddenJoints(patience=1.0)
        points, visibility = arm_frame(a_pose())
        hold(points, visibility, 0.0)
        _, hidden = arm_frame(a_pose(v13=0.0, v14=0.0))
        confidences = [hold(points, hidden, t) for t in (0.1, 0.5, 1.0, 2.0)]
        assert [round(found[1], 3) for found in confidences if found] == [0.9, 0.5, 0.0, 0.0]

    def test_one_hidden_arm_does_not_stop_the_other(self) -> None:
        hold = HiddenJoints(patience=1.0)
        points, _ = arm_frame(a_pose())
        found = [hold(points, arm_frame(a_pose(v13=0.0))[1], t) for t in (0.0, 3.0)]
        assert [each[1] for each in found if each] == [1.0, 1.0]

    def test_a_hand_is_held_with_its_hidden_elbow(self) -> None:
        hold = HiddenJoints()
        points, visibility = arm_frame(a_pose())
        hold(points, visibility, 0.0)
        wild = points.copy()
        wild[1:3] = 5.0
        result = hold(wild, arm_frame(a_pose(v13=0.2))[1], 0.1)
        assert result is not None
        np.testing.assert_allclose(result[0][3:9], points[1:3].reshape(-1))

    def test_without_a_shoulder_there_is_no_frame(self) -> None:
        assert HiddenJoints()(*arm_frame(a_pose(v12=0.2)), 0.0) is None


class TestFilm:
    def test_a_person_in_a_film_becomes_an_operator(self, person_film: Path, pose_model: Path) -> None:
        motions = load_motions(f"film:{person_film}")
        clip = motions.clips("operator")[0]
        assert clip.body.kind == "human"
        assert clip.fps == pytest.approx(15.0, rel=0.01)
        assert len(clip) == 30
        assert any("a person is seen in 30 of 30 pictures" in note for note in motions.notes)
        # The picture was turned to and fro about its middle: hands that hang from the shoulders stay below them.
        points = clip.body.arm_points(clip.frames)
        assert (points[:, :, 2, 2] < points[:, :, 0, 2]).mean() > 0.9
        # Its left arm is hidden behind a model of a shuttle.
        assert clip.body.sides == ("right",)
        assert any("the left arm is seen in" in note and "left out" in note for note in motions.notes)

    def test_a_film_is_told_by_its_ending(self, person_film: Path, pose_model: Path) -> None:
        assert load_motions(person_film).name == f"film:{person_film.name}"

    def test_nobody_in_a_film_is_said(self, tmp_path: Path, pose_model: Path) -> None:
        with pytest.raises(MotionError, match="no person was found in any of 12 pictures"):
            load_motions(f"film:{write_black_film(tmp_path / 'black.mp4')}")

    def test_a_file_that_is_no_film_is_refused(self, tmp_path: Path) -> None:
        broken = tmp_path / "broken.mp4"
        broken.write_bytes(b"not a film at all" * 100)
        with pytest.raises(MotionError, match=r"broken\.mp4 is no film"):
            FilmPictures(broken)
        with pytest.raises(MotionError, match="no film"):
            FilmPictures(tmp_path / "absent.mp4")


class TestModelFile:
    def test_a_missing_model_is_said_with_its_name_and_where_it_is_published(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv(MODEL_VARIABLE, raising=False)
        monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
        with pytest.raises(MotionError, match=r"pose_landmarker_full\.task.*ai\.google\.dev.*--model") as caught:
            find_model()
        assert str(tmp_path / "models") in str(caught.value)

    def test_another_file_is_refused_in_our_words(self, tmp_path: Path) -> None:
        pytest.importorskip("mediapipe")
        broken = tmp_path / "broken.task"
        broken.write_bytes(b"nothing")
        with pytest.raises(MotionError, match="is no pose model"):
            PoseModel(broken)
