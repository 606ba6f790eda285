"""Orders in which tools write the joints of a person when they do not name them."""

from __future__ import annotations

from dataclasses import dataclass

from syda_gym.embodiments.human import SKELETON_JOINTS

__all__ = ["AZURE_JOINTS", "CORNELL_JOINTS", "KINECT_JOINTS", "LAYOUTS", "MEDIAPIPE_JOINTS", "Layout", "layouts_of"]

KINECT_JOINTS = (
    "SpineBase", "SpineMid", "Neck", "Head",
    "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft", "ShoulderRight", "ElbowRight", "WristRight", "HandRight",
    "HipLeft", "KneeLeft", "AnkleLeft", "FootLeft", "HipRight", "KneeRight", "AnkleRight", "FootRight",
    "SpineShoulder", "HandTipLeft", "ThumbLeft", "HandTipRight", "ThumbRight",
)  # fmt: skip
"""The 25 joints of Kinect v2 in the order of the SDK's ``JointType``."""

AZURE_JOINTS = (
    "Pelvis", "SpineNavel", "SpineChest", "Neck", "ClavicleLeft", "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft",
    "HandTipLeft", "ThumbLeft", "ClavicleRight", "ShoulderRight", "ElbowRight", "WristRight", "HandRight",
    "HandTipRight",
    "ThumbRight", "HipLeft", "KneeLeft", "AnkleLeft", "FootLeft", "HipRight", "KneeRight", "AnkleRight", "FootRight",
    "Head",
    "Nose", "EyeLeft", "EarLeft", "EyeRight", "EarRight",
)  # fmt: skip
"""The 32 joints of Azure Kinect in the order of the body tracking SDK."""

MEDIAPIPE_JOINTS = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    "left_ear",
    "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_wrist",
    "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index", "left_thumb", "right_thumb", "left_hip",
    "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_heel", "right_heel", "left_foot_index",
    "right_foot_index",
)  # fmt: skip
"""The 33 landmarks of MediaPipe's pose."""

CORNELL_JOINTS = (
    "Head", "Neck", "Torso", "LShoulder", "LElbow", "RShoulder", "RElbow", "LHip", "LKnee", "RHip", "RKnee",
    "LHand", "RHand", "LFoot", "RFoot",
)  # fmt: skip
"""Joint order of the Cornell data sets; the first eleven have an orientation."""


@dataclass(frozen=True)
class Layout:
    """One order of joints.

    Attributes:
        name: for messages.
        format: prefix of ``load_motions`` under which its files go.
        joints: canonical joint or ``-`` per point; several points of one name are averaged (ears make the head).
        up: the axis that the tool points up.
        zero_is_gap: whether (0, 0, 0) says that a joint was lost.
        image: whether the tool also writes places in the picture in the same shape.
    """

    name: str
    format: str
    joints: tuple[str, ...]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    zero_is_gap: bool = False
    image: bool = False


def _of(text: str) -> tuple[str, ...]:
    return tuple(text.split())


_DOWN = (0.0, -1.0, 0.0)
_KINECT2 = _of(
    "Pelvis Torso - Head LShoulder LElbow LHand - RShoulder RElbow RHand - LHip LKnee LFoot LToe RHip RKnee RFoot RToe "
    "Neck - - - -"
)
_AZURE = _of(
    "Pelvis Torso - Neck - LShoulder LElbow LHand - - - - RShoulder RElbow RHand - - - LHip LKnee LFoot LToe "
    "RHip RKnee RFoot RToe Head Nose - - - -"
)
_MEDIAPIPE = _of(
    "Nose - - - - - - Head Head - - LShoulder RShoulder LElbow RElbow LHand RHand - - - - - - LHip RHip LKnee RKnee "
    "LFoot RFoot - - LToe RToe"
)
_KINECT1 = _of(
    "Pelvis Torso Neck Head LShoulder LElbow LHand - RShoulder RElbow RHand - LHip LKnee LFoot LToe RHip RKnee RFoot "
    "RToe"
)
_NITE2 = _of("Head Neck LShoulder RShoulder LElbow RElbow LHand RHand Torso LHip RHip LKnee RKnee LFoot RFoot")
_COCO = _of("Nose - - Head Head LShoulder RShoulder LElbow RElbow LHand RHand LHip RHip LKnee RKnee LFoot RFoot")
_SMPL = _of(
    "Pelvis LHip RHip - LKnee RKnee Torso LFoot RFoot - LToe RToe Neck - - Head LShoulder RShoulder LElbow RElbow "
    "LHand RHand"
)
_H36M = _of("Pelvis RHip RKnee RFoot LHip LKnee LFoot Torso Neck - Head LShoulder LElbow LHand RShoulder RElbow RHand")

LAYOUTS: tuple[Layout, ...] = (
    Layout("Kinect v2, 25 joints", "kinect", _KINECT2),
    Layout("Kinect v1, 20 joints", "kinect", _KINECT1, zero_is_gap=True),
    Layout("Azure Kinect, 32 joints", "azure", _AZURE, _DOWN),
    Layout("MediaPipe, 33 landmarks", "mediapipe", _MEDIAPIPE, _DOWN, image=True),
    Layout("OpenNI, 15 joints", "openni", SKELETON_JOINTS, zero_is_gap=True),
    Layout("NiTE 2, 15 joints", "openni", _NITE2, zero_is_gap=True),
    Layout("Cornell, 15 joints", "openni", CORNELL_JOINTS, zero_is_gap=True),
    Layout("COCO, 17 keypoints", "keypoints", _COCO, _DOWN, image=True),
    Layout("Human3.6M, 17 joints", "keypoints", _H36M, (0.0, 0.0, 1.0)),
    Layout("MPI-INF-3DHP, 17 joints", "keypoints",
           _of("- Neck RShoulder RElbow RHand LShoulder LElbow LHand RHip RKnee RFoot LHip LKnee LFoot Pelvis Torso "
           "Head"),
           _DOWN),
    Layout("Human3.6M, 16 joints", "keypoints",
           _of("Pelvis RHip RKnee RFoot LHip LKnee LFoot Torso Neck Head LShoulder LElbow LHand RShoulder RElbow "
               "RHand")),
    Layout("Human3.6M, 32 joints", "keypoints",
           _of("Pelvis RHip RKnee RFoot RToe - LHip LKnee LFoot LToe - - Torso Neck - Head - LShoulder LElbow LHand "
           "- - - - - "
               "RShoulder RElbow RHand - - - -"), (0.0, 0.0, 1.0)),
    Layout("SMPL, 22 joints", "keypoints", _SMPL),
    Layout("SMPL, 23 joints", "keypoints", (*_SMPL, "-")),
    Layout("SMPL without its root, 23 joints", "keypoints", (*_SMPL[1:], "-", "-")),
    Layout("SMPL, 24 joints", "keypoints", (*_SMPL, "-", "-")),
    Layout("SMPL-H, 52 joints", "keypoints", (*_SMPL, *("-",) * 30)),
    Layout("SMPL-X, 55 joints", "keypoints", (*_SMPL, *("-",) * 33)),
    Layout("LAFAN, 22 joints", "keypoints",
           _of("Pelvis LHip LKnee LFoot LToe RHip RKnee RFoot RToe - Torso - Neck Head - LShoulder LElbow LHand - "
           "RShoulder "
               "RElbow RHand")),
    Layout("Xsens, 23 joints", "keypoints",
           _of("Pelvis - Torso - - Neck Head - RShoulder RElbow RHand - LShoulder LElbow LHand RHip RKnee RFoot RToe "
           "LHip LKnee "
               "LFoot LToe"), (0.0, 0.0, 1.0)),
    Layout("KIT, 21 joints", "keypoints",
           _of("Pelvis - Torso Neck Head RShoulder RElbow RHand LShoulder LElbow LHand RHip RKnee RFoot - RToe LHip "
           "LKnee LFoot "
               "- LToe")),
    Layout("TotalCapture, 21 joints", "keypoints",
           _of("Pelvis - Torso - - Neck Head RShoulder RElbow RHand - LShoulder LElbow LHand - RHip RKnee RFoot LHip "
           "LKnee "
               "LFoot")),
    Layout("OpenPose, 25 keypoints", "keypoints",
           _of("Nose Neck RShoulder RElbow RHand LShoulder LElbow LHand Pelvis RHip RKnee RFoot LHip LKnee LFoot - - "
           "Head Head "
               "LToe - - RToe - -"), _DOWN, zero_is_gap=True, image=True),
    Layout("OpenPose, 18 keypoints", "keypoints",
           _of("Nose Neck RShoulder RElbow RHand LShoulder LElbow LHand RHip RKnee RFoot LHip LKnee LFoot - - Head "
               "Head"), _DOWN,
           zero_is_gap=True, image=True),
    Layout("Panoptic, 19 joints", "keypoints",
           _of("Neck Nose Pelvis LShoulder LElbow LHand LHip LKnee LFoot RShoulder RElbow RHand RHip RKnee RFoot - "
           "Head - Head"),
           _DOWN),
    Layout("HALPE, 26 keypoints", "keypoints", (*_COCO, *_of("- Neck Pelvis LToe RToe - - - -")), _DOWN, image=True),
    Layout("LSP, 14 joints", "keypoints",
           _of("RFoot RKnee RHip LHip LKnee LFoot RHand RElbow RShoulder LShoulder LElbow LHand Neck Head")),
    Layout("COCO whole body, 133 keypoints", "keypoints", (*_COCO, *("-",) * 116), _DOWN, image=True),
)  # fmt: skip
"""Every order that is known, the likelier first."""


def layouts_of(count: int, format: str | None = None) -> list[Layout]:
    """The orders with so many points, those of one format only if it is named."""
    return [layout for layout in LAYOUTS if len(layout.joints) == count and format in (None, layout.format)]
