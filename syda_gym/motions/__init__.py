"""WHAT is moved: clips, takes of several bodies, and frames of two bodies paired."""

from syda_gym.motions.clip import PROTOCOLS, MotionClip, Motions, PairedClip, PairedMotions, Take
from syda_gym.motions.loading import load_motions, resampled
from syda_gym.motions.readers.npz import save_motions
from syda_gym.motions.synthetic import generate

__all__ = [
    "PROTOCOLS",
    "MotionClip",
    "Motions",
    "PairedClip",
    "PairedMotions",
    "Take",
    "generate",
    "load_motions",
    "resampled",
    "save_motions",
]
