"""The direct autoencoder of the paper's comparison: A's encoder and B's decoder trained on A-to-B alone.

Sizes, loss and optimiser are those of SyDa, so that the comparison is fair. It maps one way only.
"""

from __future__ import annotations

from collections.abc import Sequence

from syda_gym.mappings.card import card_of
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.coders import paper_coder
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.methods.syda import paper_settings
from syda_gym.mappings.models.autoencoder_training import Job, Progress, train
from syda_gym.mappings.models.regressors import DirectRegressor
from syda_gym.mappings.models.scaling import Scaler

__all__ = ["fit_direct_paper"]


def fit_direct_paper(jobs: Sequence[FitJob], progress: Progress | None = None) -> list[CodedMapping]:
    """The direct autoencoder on raw metres and quaternions, as the ``paper`` preset of SyDa."""
    coders = [(paper_coder(job.pair.source_body), paper_coder(job.pair.target_body)) for job in jobs]
    data = [
        Job(a.encode(job.pair.source)[:, 0], b.encode(job.pair.target)[:, 0], job.seed)
        for job, (a, b) in zip(jobs, coders, strict=True)
    ]
    result = []
    trained = train(data, paper_settings(jobs[0], dual=False), progress)
    for job, (a, b), stacks in zip(jobs, coders, trained, strict=True):
        regressor = DirectRegressor(stacks, Scaler.identity(a.width), Scaler.identity(b.width))
        card = card_of(job.pair, "direct", job.preset, job.seed, job.options)
        result.append(CodedMapping(card, a, b, regressor))
    return result
