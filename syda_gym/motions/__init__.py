"""WHAT is moved: clips, takes of several bodies, and frames of two bodies paired."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from syda_gym.motions.clip import PROTOCOLS as PROTOCOLS
    from syda_gym.motions.clip import MotionClip as MotionClip
    from syda_gym.motions.clip import Motions as Motions
    from syda_gym.motions.clip import PairedClip as PairedClip
    from syda_gym.motions.clip import PairedMotions as PairedMotions
    from syda_gym.motions.clip import Take as Take
    from syda_gym.motions.dataset import read_dataset as read_dataset
    from syda_gym.motions.dataset import write_dataset as write_dataset
    from syda_gym.motions.how_to_read import HowToRead as HowToRead
    from syda_gym.motions.info import MotionsInfo as MotionsInfo
    from syda_gym.motions.info import describe as describe
    from syda_gym.motions.loading import FORMATS as FORMATS
    from syda_gym.motions.loading import load_motions as load_motions
    from syda_gym.motions.pairing.alignment import ActionQuality as ActionQuality
    from syda_gym.motions.pairing.alignment import Alignment as Alignment
    from syda_gym.motions.pairing.alignment import align as align
    from syda_gym.motions.pairing.alignment import pair_quality as pair_quality
    from syda_gym.motions.pairing.alignment import pair_recordings as pair_recordings
    from syda_gym.motions.pairing.conform import conformed as conformed
    from syda_gym.motions.pairing.dataset_check import Finding as Finding
    from syda_gym.motions.pairing.dataset_check import validate_dataset as validate_dataset
    from syda_gym.motions.pairing.recorded_session import Session as Session
    from syda_gym.motions.pairing.recorded_session import operator_clips as operator_clips
    from syda_gym.motions.pairing.recorded_session import pair_session as pair_session
    from syda_gym.motions.readers.own.npz import save_motions as save_motions
    from syda_gym.motions.readers.skeleton import MotionWarning as MotionWarning
    from syda_gym.motions.resampling import resampled as resampled
    from syda_gym.motions.stick_figures import draw_clips as draw_clips
    from syda_gym.motions.synthetic.generator import generate as generate

# Readers and scipy are loaded when they are first used: rooms above only need clips.
_LAZY = {
    "ActionQuality": "pairing.alignment",
    "Alignment": "pairing.alignment",
    "FORMATS": "loading",
    "Finding": "pairing.dataset_check",
    "HowToRead": "how_to_read",
    "MotionClip": "clip",
    "MotionWarning": "readers.skeleton",
    "Motions": "clip",
    "MotionsInfo": "info",
    "PROTOCOLS": "clip",
    "PairedClip": "clip",
    "PairedMotions": "clip",
    "Session": "pairing.recorded_session",
    "Take": "clip",
    "align": "pairing.alignment",
    "conformed": "pairing.conform",
    "describe": "info",
    "draw_clips": "stick_figures",
    "generate": "synthetic.generator",
    "load_motions": "loading",
    "operator_clips": "pairing.recorded_session",
    "pair_quality": "pairing.alignment",
    "pair_recordings": "pairing.alignment",
    "pair_session": "pairing.recorded_session",
    "read_dataset": "dataset",
    "resampled": "resampling",
    "save_motions": "readers.own.npz",
    "validate_dataset": "pairing.dataset_check",
    "write_dataset": "dataset",
}

__all__ = [
    "FORMATS",
    "PROTOCOLS",
    "ActionQuality",
    "Alignment",
    "Finding",
    "HowToRead",
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


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
