"""Fitting: one entry for all methods and presets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from syda_gym.errors import MappingError, OptionError, nearest_name
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.methods.classic import fit_accurate, fit_kernel_ridge, fit_nearest, fit_ridge
from syda_gym.mappings.methods.direct import fit_direct_paper
from syda_gym.mappings.methods.general import fit_direct_general, fit_interpolation, fit_nested, fit_synergies
from syda_gym.mappings.methods.geometric import fit_fixed_axes, fit_mink, fit_procrustes
from syda_gym.mappings.methods.jobs import FitJob, Fitter, check_pair
from syda_gym.mappings.methods.prior import fit_general
from syda_gym.mappings.methods.syda import fit_paper
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.motions.clip import PairedMotions

__all__ = ["METHODS", "Method", "fit", "fit_many"]


@dataclass(frozen=True)
class Method:
    """A way to fit a mapping.

    Attributes:
        presets: preset name to the function that fits; the first one is the default.
        invertible: whether its mappings have an inverse.
        summary: one line for help texts.
        seeded: whether fits depend on the seed.
    """

    presets: dict[str, Fitter]
    invertible: bool
    summary: str
    seeded: bool = True

    @property
    def default(self) -> str:
        """The preset that is taken when none is named."""
        return next(iter(self.presets))


METHODS: dict[str, Method] = {
    "syda": Method(
        {
            "general": fit_general,
            "synergies": fit_synergies,
            "nested": fit_nested,
            "accurate": fit_accurate,
            "interpolation": fit_interpolation,
            "paper": fit_paper,
        },
        True,
        "dual autoencoder with shared synergies; maps both ways",
    ),
    "direct": Method(
        {"general": fit_direct_general, "paper": fit_direct_paper}, False, "encoder of A, decoder of B, trained one way"
    ),
    "ridge": Method({"general": fit_ridge}, False, "ridge regression per arm", seeded=False),
    "kernel_ridge": Method({"general": fit_kernel_ridge}, False, "kernel ridge regression per arm", seeded=False),
    "nearest": Method({"general": fit_nearest}, False, "the most similar training frame", seeded=False),
    "geometric": Method(
        {"procrustes": fit_procrustes, "fixed": fit_fixed_axes},
        True,
        "a rotation, then closed-form inverse kinematics",
        seeded=False,
    ),
    "mink": Method({"procrustes": fit_mink}, False, "the same decoded by mink (extra 'ik')", seeded=False),
}
"""Every method by name."""


def fit(
    pair: PairedMotions,
    method: str = "syda",
    preset: str | None = None,
    seed: int = 0,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> CodedMapping:
    """Fits a mapping from a pair's source to its target.

    Args:
        pair: paired frames, for example ``motions.pair("adult", "pepper")``.
        method: one of ``METHODS``.
        preset: one of the method's presets; its default if ``None``.
        seed: of everything random; the same seed gives the same mapping bit by bit.
        progress: told the finished fraction, 0 to 1.
        **options: of the preset, see its documentation.

    Returns:
        The mapping.

    Raises:
        OptionError: unknown method, preset or option.
        MappingError: frames from which nothing can be learnt.
    """
    return fit_many([pair], method, preset, [seed], progress=progress, **options)[0]


def fit_many(
    pairs: Sequence[PairedMotions],
    method: str = "syda",
    preset: str | None = None,
    seeds: Sequence[int] | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> list[CodedMapping]:
    """Fits several mappings between the same two bodies at once, as folds and seeds of a study.

    Networks are trained together as one batched network, which is several times faster than one by one.

    Args:
        pairs: training frames of each fit.
        method: one of ``METHODS``.
        preset: one of the method's presets.
        seeds: one per pair; 0 for all if ``None``.
        progress: told the finished fraction, 0 to 1.
        **options: of the preset.

    Returns:
        One mapping per pair.

    Raises:
        OptionError: unknown method, preset or option, or as many seeds as pairs are not given.
        MappingError: frames from which nothing can be learnt.
    """
    if method not in METHODS:
        raise OptionError(f"unknown method {method!r}; {nearest_name(method, METHODS)}")
    chosen = METHODS[method]
    name = preset or chosen.default
    if name not in chosen.presets:
        raise OptionError(f"method {method!r} has no preset {name!r}; {nearest_name(name, chosen.presets)}")
    numbers = [0] * len(pairs) if seeds is None else [int(seed) for seed in seeds]
    if len(numbers) != len(pairs) or not pairs:
        raise OptionError(f"{len(pairs)} pairs and {len(numbers)} seeds; give one seed per pair, at least one pair")
    bodies = (pairs[0].source_body, pairs[0].target_body)
    for pair in pairs:
        if (pair.source_body, pair.target_body) != bodies:
            raise MappingError(f"fits made together need the same two bodies; got {pairs[0]!r} and {pair!r}")
        check_pair(pair)
    jobs = [FitJob(pair, name, seed, options) for pair, seed in zip(pairs, numbers, strict=True)]
    return chosen.presets[name](jobs, progress)
