"""From the 33 landmarks of a picture to the joints that this library knows, and what to do with hidden ones."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.motions.film.pose_model import Pose

__all__ = ["ARM_JOINTS", "BONES_SEEN", "JOINTS", "HiddenJoints", "arm_frame"]

JOINTS = {
    "Nose": 0, "LShoulder": 11, "RShoulder": 12, "LElbow": 13, "RElbow": 14, "LHand": 15, "RHand": 16,
    "LHip": 23, "RHip": 24, "LKnee": 25, "RKnee": 26, "LFoot": 27, "RFoot": 28, "LToe": 31, "RToe": 32,
}  # fmt: skip
"""Joint to its landmark. https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker"""

ARM_JOINTS = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")

BONES_SEEN = (
    (11, 12), (11, 13), (13, 15), (12, 14), (14, 16), (11, 23), (12, 24), (23, 24), (23, 25), (25, 27),
    (24, 26), (26, 28),
)  # fmt: skip
"""Landmarks to join by lines when a picture is shown."""

VISIBLE = 0.5
"""Landmarks that the model is less sure of count as hidden."""

_HELD_FOR = 1.0  # s; how long a hidden elbow or hand is believed to stay where it was
_ROWS = [JOINTS[name] for name in ARM_JOINTS]
# The picture's x, y, z (right, down, away from a camera that is faced) to the recordings' (the subject's right,
# right, up, backward): a person who faces the camera has the right hand at the picture's left.
_TO_SUBJECT = np.array([-1.0, -1.0, 1.0])


def arm_frame(pose: Pose) -> tuple[FloatArray, FloatArray]:
    """Shoulders, elbows and hands ``(6, 3)`` [m], x to the subject's right, y up, z backward; visibility ``(6,)``."""
    return pose.world[_ROWS] * _TO_SUBJECT, pose.visibility[_ROWS]


class HiddenJoints:
    """Holds elbows and hands that are hidden where they were last seen, relative to their shoulder.

    An elbow that was never seen hangs down, and so does a hand. Confidence in an arm with a held joint falls from 1 to
    0 within ``patience`` seconds. The better arm counts, for the robot's other arm stands still with what is held;
    where both are hidden, the robot first slows and then stands still instead of guessing.

    Args:
        patience: seconds for which a hidden joint is believed to be where it was.
    """

    def __init__(self, patience: float = _HELD_FOR) -> None:
        self.patience = patience
        self._offset = np.array([[0.0, -0.29 * (i % 3), 0.0] for i in range(6)])
        self._seen = np.full(6, -np.inf)

    def __call__(self, points: FloatArray, visibility: FloatArray, time: float) -> tuple[FloatArray, float] | None:
        """One frame.

        Args:
            points: ``(6, 3)`` [m], see ``arm_frame``.
            visibility: ``(6,)``.
            time: of the picture [s].

        Returns:
            The frame ``(18,)`` and the confidence in it, or ``None`` if a shoulder is hidden.
        """
        if visibility[0] < VISIBLE or visibility[3] < VISIBLE:
            return None
        result = points.copy()
        arms = []
        for arm in (0, 3):
            confidence, hidden = 1.0, False
            for joint in (arm + 1, arm + 2):
                hidden = hidden or visibility[joint] < VISIBLE  # a hand hangs on its elbow: it is held with it
                if hidden:
                    result[joint] = points[arm] + self._offset[joint]
                    confidence = min(confidence, max(0.0, 1.0 - (time - self._seen[joint]) / self.patience))
                else:
                    self._offset[joint] = points[joint] - points[arm]
                    self._seen[joint] = time
                    confidence = min(confidence, _sure(float(visibility[joint])))
            arms.append(confidence)
        return result.reshape(-1), max(arms)


def _sure(visibility: float) -> float:
    """Confidence of a joint that is seen: 0.6, from which the robot is not slowed, just where it counts as visible."""
    return 0.6 + 0.4 * (visibility - VISIBLE) / (1.0 - VISIBLE)
