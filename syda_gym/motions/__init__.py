"""WHAT is moved: clips, takes of several bodies, and frames of two bodies paired."""

from syda_gym.motions.clip import PROTOCOLS, MotionClip, Motions, PairedClip, PairedMotions, Take
from syda_gym.motions.dataset import read_dataset, write_dataset
from syda_gym.motions.info import MotionsInfo, describe
from syda_gym.motions.loading import FORMATS, load_motions
from syda_gym.motions.pairing.alignment import ActionQuality, Alignment, align, pair_quality, pair_recordings
from syda_gym.motions.pairing.conform import conformed
from syda_gym.motions.pairing.dataset_check import Finding, validate_dataset
from syda_gym.motions.pairing.recorded_session import Session, operator_clips, pair_session
from syda_gym.motions.readers.own.npz import save_motions
from syda_gym.motions.readers.skeleton import MotionWarning
from syda_gym.motions.resampling import resampled
from syda_gym.motions.stick_figures import draw_clips
from syda_gym.motions.synthetic.generator import generate

__all__ = [
    "FORMATS",
    "PROTOCOLS",
    "ActionQuality",
    "Alignment",
    "Finding",
    "MotionClip",
    "MotionWarning",
    "Motions",
    "MotionsInfo",
    "PairedClip",
    "PairedMotions",
    "Session",
    "Take",
    "align",
    "conformed",
    "describe",
    "draw_clips",
    "generate",
    "load_motions",
    "operator_clips",
    "pair_quality",
    "pair_recordings",
    "pair_session",
    "read_dataset",
    "resampled",
    "save_motions",
    "validate_dataset",
    "write_dataset",
]
