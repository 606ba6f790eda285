"""SyDa: synergy mapping via dual autoencoder (Section 3.1 of the paper), in the paper's own preset.

Two autoencoders, one per body, are trained together so that they reconstruct their own body (Eq. 2 and 3) and share
their latent features, the synergies (Eq. 4). One body's encoder followed by the other's decoder is the mapping, so one
model maps both ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from syda_gym.errors import OptionError, nearest_name
from syda_gym.mappings.card import card_of
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.coders import paper_coder
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.models.autoencoder_training import Job, Progress, train
from syda_gym.mappings.models.regressors import DualRegressor
from syda_gym.mappings.models.scaling import Scaler
from syda_gym.mappings.models.settings import TrainingSettings

__all__ = ["HUMAN_WIDTHS", "ROBOT_WIDTHS", "fit_paper", "paper_settings", "with_options"]

HUMAN_WIDTHS = (16, 14, 12)
"""The authors' hidden widths between a human's 18 numbers and the 10 synergies."""

ROBOT_WIDTHS = (32, 24, 16)
"""The authors' hidden widths between Pepper's 40 quaternion numbers and the 10 synergies."""


def paper_settings(job: FitJob, *, dual: bool = True) -> TrainingSettings:
    """The authors' networks and optimiser for a job's bodies, changed by its options."""
    widths = [HUMAN_WIDTHS if body.kind == "human" else ROBOT_WIDTHS for body in _bodies(job)]
    return with_options(TrainingSettings(hidden_a=widths[0], hidden_b=widths[1], dual=dual), job.options)


def with_options(settings: TrainingSettings, options: dict[str, Any]) -> TrainingSettings:
    """Settings changed by options of the same names.

    Raises:
        OptionError: an option that does not exist; the message says which do.
    """
    names = {field.name for field in fields(TrainingSettings)} - {"dual"}
    for name in options:
        if name not in names:
            raise OptionError(f"unknown option {name!r}; {nearest_name(name, names)}")
    return replace(settings, **options)


def fit_paper(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """SyDa as published: raw metres and quaternions, Huber losses 1:1:1, no standardisation."""
    coders = [(paper_coder(a), paper_coder(b)) for a, b in (_bodies(job) for job in jobs)]
    data = [
        Job(_rows(a.encode(job.pair.source)), _rows(b.encode(job.pair.target)), job.seed)
        for job, (a, b) in zip(jobs, coders, strict=True)
    ]
    result = []
    for job, (a, b), stacks in zip(jobs, coders, train(data, paper_settings(jobs[0]), progress), strict=True):
        regressor = DualRegressor(stacks, Scaler.identity(a.width), Scaler.identity(b.width))
        card = card_of(job.pair, "syda", job.preset, job.seed, job.options)
        result.append(CodedMapping(card, a, b, regressor))
    return result


def _bodies(job: FitJob) -> tuple[Any, Any]:
    return job.pair.source_body, job.pair.target_body


def _rows(codes: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return codes.reshape(-1, codes.shape[-1])
