"""Does transferability predict? Its rank correlation with the held-out error of chains, beside simpler rivals.

Every pair of bodies is fitted without the actions of a fold and every chain is scored on them, so that no frame of a
test action is seen by any link. A chain's error is the mean distance of elbows and wrists [m] over the target's arm
length, on the arms that both its ends have.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import OptionError
from syda_gym.evaluation.prediction.results import PredictionStudy, RouteResult
from syda_gym.evaluation.prediction.scores import score_predictors
from syda_gym.evaluation.prediction.trial import BedFrames, Progress, fit_all, held_out_errors
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.rehearsal import Rehearsal
from syda_gym.routes.general import Sampling
from syda_gym.routes.measured import fit_options, measured_bodies
from syda_gym.routes.metric import Transferability, transferability
from syda_gym.routes.noise import alpha_from_noise, sensor_noise

__all__ = ["motion_noise", "validate"]

Names = tuple[str, ...]


def validate(
    motions: str | Motions = "embedded",
    *,
    bodies: Sequence[str] | None = None,
    method: str = "syda",
    preset: str | None = None,
    folds: int = 4,
    fps: float = 5.0,
    max_hops: int = 3,
    samples: int = Sampling.samples,
    seed: int = 0,
    resamples: int = 1000,
    progress: Progress | None = None,
) -> PredictionStudy:
    """Measures how well transferability and its rivals predict the error of every route.

    Args:
        motions: recordings in which all bodies move together.
        bodies: who takes part; everybody by default.
        method: how pairs are fitted, see ``fitting.METHODS``; one model serves both ways where it inverts.
        preset: of the method.
        folds: into how many groups the actions are split; each is held out once. As many as actions is full LOAO.
        fps: frames per second that are kept; neighbours at 30 Hz are near-duplicates.
        max_hops: longest chain.
        samples: Sobol samples per arm for the general definition.
        seed: of folds, fits and samples.
        resamples: bootstrap samples of the intervals.
        progress: told the stage (``fit``, ``chains``) and its finished fraction.

    Returns:
        Routes, errors, predictors and their rank correlations.

    Raises:
        MotionError: fewer than three bodies or two actions recorded together.
        OptionError: folds or hops out of range.
    """
    full = load_motions(motions)
    names = tuple(bodies) if bodies else tuple(full.bodies)
    table = BedFrames.of(load_motions(full, fps=fps), names)
    if not 2 <= folds <= len(table.distinct):
        raise OptionError(f"folds must be between 2 and the number of actions, {len(table.distinct)}; got {folds}")
    if max_hops < 1:
        raise OptionError(f"max_hops must be at least 1, got {max_hops}")
    noise = motion_noise(full, names)
    links = _links(table.bodies, samples, seed)
    groups = np.array_split(np.random.default_rng(seed).permutation(table.distinct), folds)
    fits = fit_all(table, groups, method, preset, seed, fit_options(preset, fps), progress)
    training, errors = held_out_errors(table, groups, fits, max_hops, progress)
    routes = _results(table.bodies, links, alpha_from_noise(noise), training, errors, seed)
    complete = [route for route in routes if all(len(table.bodies[name].sides) == 2 for name in route.bodies)]
    partial = 0 < len(complete) < len(routes)
    return PredictionStudy(
        motions=full.name,
        synthetic=full.synthetic,
        bodies=names,
        method=method,
        folds=folds,
        seed=seed,
        noise=noise,
        links=links["general"],
        routes=routes,
        scores=score_predictors(routes, seed=seed, resamples=resamples),
        full_scores=score_predictors(complete, seed=seed, resamples=resamples) if partial else (),
    )


def motion_noise(motions: Motions, names: Sequence[str] | None = None) -> dict[str, float]:
    """High-frequency noise of each body's landmarks over its arm length, at the full frame rate.

    Args:
        motions: recordings.
        names: bodies; all by default.

    Returns:
        Body to noise, to be given to ``transferability.noise.alpha_from_noise``.
    """
    return {name: noise / motions.bodies[name].reach for name, noise in sensor_noise(motions, names).items()}


def _links(bodies: dict[str, Embodiment], samples: int, seed: int) -> dict[str, dict[tuple[str, str], Transferability]]:
    ends = list(permutations(bodies, 2))
    return {
        "general": {
            (a, b): transferability(bodies[a], bodies[b], "general", samples=samples, seed=seed) for a, b in ends
        },
        "paper": {(a, b): transferability(bodies[a], bodies[b], "paper") for a, b in ends},
    }


def _results(
    bodies: dict[str, Embodiment],
    links: dict[str, dict[tuple[str, str], Transferability]],
    alpha: dict[frozenset[str], float],
    training: dict[tuple[str, str], float],
    errors: dict[Names, float],
    seed: int,
) -> tuple[RouteResult, ...]:
    results = []
    quality, together = measured_bodies(training), Rehearsal(bodies, default_plan(), seed=seed)
    for route, metres in errors.items():
        steps = list(zip(route[:-1], route[1:], strict=True))
        general = [links["general"][step] for step in steps]
        back = [links["general"][b, a] for a, b in steps]
        products = {
            "T": [link.T for link in general],
            "T_with_noise_alpha": [link.T * alpha[frozenset(step)] for link, step in zip(general, steps, strict=True)],
            "paper_T": [links["paper"][step].T for step in steps],
            "C": [link.C for link in general],
            "L": [link.L for link in general],
            "coverage": [link.coverage for link in general],
            "C_both_ways": [link.C * other.C for link, other in zip(general, back, strict=True)],
            "noise_alpha": [alpha[frozenset(step)] for step in steps],
        }
        carried = _carried(bodies, route)
        predicted = {name: carried * float(np.prod(values)) for name, values in products.items()}
        predicted["dry_run"] = -float(together.error(route).mean())
        predicted["arm_length_ratio"] = links["general"][route[0], route[-1]].L
        predicted["hops"] = -float(len(steps))
        predicted["training_error"] = -sum(training[step] for step in steps) / max(carried, 1e-3)
        predicted["measured"] = -quality.error(route) / max(carried, 1e-3)
        results.append(RouteResult(route, metres / bodies[route[-1]].reach, metres, predicted))
    return tuple(results)


def _carried(bodies: dict[str, Embodiment], route: Names) -> float:
    """Share of the arms of both ends that every body on the way has, as in ``transferability.routing``."""
    shared = [side for side in bodies[route[0]].sides if side in bodies[route[-1]].sides]
    kept = [side for side in shared if all(side in bodies[name].sides for name in route)]
    return len(kept) / len(shared) if shared else 1.0
