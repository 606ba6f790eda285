"""Does transferability predict? Its rank correlation with the held-out error of chains, beside simpler rivals.

Every pair of bodies is fitted without the actions of a fold and every chain is scored on them, so that no frame of a
test action is seen by any link. A chain's error is the mean distance of elbows and wrists [m] over the target's arm
length, on the arms that both its ends have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError, OptionError
from syda_gym.evaluation.prediction.results import PredictionStudy, RouteResult
from syda_gym.evaluation.prediction.scores import score_predictors
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions
from syda_gym.routes.measured import MeasuredBodies, measured_bodies
from syda_gym.routes.metric import Transferability, transferability
from syda_gym.routes.noise import alpha_from_noise, high_frequency_noise

__all__ = ["measure_bodies", "motion_noise", "validate"]

Progress = Callable[[str, float], None]
Names = tuple[str, ...]

_LAG_SECONDS = 0.2
_MOST_TEST_FRAMES = 120
_MOST_TRAINING_FRAMES = 400


def validate(
    motions: str | Motions = "embedded",
    *,
    bodies: Sequence[str] | None = None,
    method: str = "syda",
    preset: str | None = None,
    folds: int = 4,
    fps: float = 5.0,
    max_hops: int = 3,
    samples: int = 2**18,
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
    table = _Frames.of(load_motions(full, fps=fps), names)
    if not 2 <= folds <= len(table.distinct):
        raise OptionError(f"folds must be between 2 and the number of actions, {len(table.distinct)}; got {folds}")
    if max_hops < 1:
        raise OptionError(f"max_hops must be at least 1, got {max_hops}")
    noise = motion_noise(full, names)
    links = _links(table.bodies, samples, seed)
    groups = np.array_split(np.random.default_rng(seed).permutation(table.distinct), folds)
    fits = _fit_all(table, groups, method, preset, seed, _fit_options(preset, fps), progress)
    training, errors = _errors(table, groups, fits, max_hops, progress)
    routes = _results(table.bodies, links, alpha_from_noise(noise), training, errors)
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


def measure_bodies(
    motions: str | Motions,
    pairs: Sequence[tuple[str, str]] | None = None,
    *,
    method: str = "syda",
    preset: str | None = None,
    fps: float = 5.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> MeasuredBodies:
    """Fits pairs and turns their training errors into a predictor for routing.

    Args:
        motions: recordings.
        pairs: which to fit; all that were recorded together by default.
        method: how pairs are fitted.
        preset: of the method.
        fps: frames per second that are kept.
        seed: of the fits.
        progress: told the stage (``fit``) and its finished fraction.

    Returns:
        Pass it as ``predictor`` to ``best_route``, or ask its ``error(route)``.
    """
    recorded = load_motions(load_motions(motions), fps=fps)
    chosen = list(pairs or recorded.pairs)
    errors: dict[tuple[str, str], float] = {}
    for done, (a, b) in enumerate(chosen):
        if recorded.bodies[a].kind > recorded.bodies[b].kind:
            a, b = b, a  # human to robot is the fitted direction
        pair = recorded.pair(a, b)
        (model,) = fit_many([pair], method, preset, [seed], **_fit_options(preset, fps))
        rows = np.arange(len(pair))[:: max(1, len(pair) // _MOST_TRAINING_FRAMES)]
        for link, given, wanted in ((model, pair.source, pair.target), (model.inverse(), pair.target, pair.source)):
            gap = _gap(link.source, link.target, link(given[rows]), wanted[rows])
            errors[link.source.name, link.target.name] = gap / link.target.reach
        if progress:
            progress("fit", (done + 1) / len(chosen))
    return measured_bodies(errors)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Frames of all bodies at the same instants."""

    motions: Motions
    bodies: dict[str, Embodiment]
    frames: dict[str, FloatArray]
    actions: NDArray[np.str_]

    @classmethod
    def of(cls, motions: Motions, names: Names) -> _Frames:
        missing = [name for name in names if name not in motions.bodies]
        takes = [take for take in motions.takes if all(name in take.frames for name in names)]
        if missing or len(names) < 3 or len({take.action for take in takes}) < 2:
            raise MotionError(
                f"{motions.name}: validation needs at least three bodies recorded together in two actions; "
                f"{', '.join(names)} share {len(takes)} takes"
            )
        together = Motions(motions.name, tuple(takes), motions.bodies, motions.families, motions.synthetic)
        frames = {name: np.concatenate([take.frames[name] for take in takes]) for name in names}
        actions = np.concatenate([np.repeat(take.action, len(take.frames[names[0]])) for take in takes])
        return cls(together, {name: motions.bodies[name] for name in names}, frames, actions)

    @property
    def distinct(self) -> NDArray[np.str_]:
        return np.unique(self.actions)

    def rows(self, held: NDArray[np.str_], test: bool) -> NDArray[np.intp]:
        """Rows of the held-out actions, or of the others, evenly thinned to a bearable number."""
        rows = np.flatnonzero(np.isin(self.actions, held) == test)
        most = _MOST_TEST_FRAMES if test else _MOST_TRAINING_FRAMES
        return rows[:: max(1, -(-len(rows) // most))]


def motion_noise(motions: Motions, names: Sequence[str] | None = None) -> dict[str, float]:
    """High-frequency noise of each body's landmarks over its arm length, at the full frame rate.

    Args:
        motions: recordings.
        names: bodies; all by default.

    Returns:
        Body to noise, to be given to ``transferability.noise.alpha_from_noise``.
    """
    found = {}
    for name in names or motions.bodies:
        body = motions.bodies[name]
        clips = [body.landmarks(clip.frames) for clip in motions.clips(name) if len(clip) > 3]
        found[name] = high_frequency_noise(clips) / body.reach
    return found


def _links(bodies: dict[str, Embodiment], samples: int, seed: int) -> dict[str, dict[tuple[str, str], Transferability]]:
    ends = list(permutations(bodies, 2))
    return {
        "general": {
            (a, b): transferability(bodies[a], bodies[b], "general", samples=samples, seed=seed) for a, b in ends
        },
        "paper": {(a, b): transferability(bodies[a], bodies[b], "paper") for a, b in ends},
    }


def _fit_all(
    table: _Frames,
    groups: Sequence[NDArray[np.str_]],
    method: str,
    preset: str | None,
    seed: int,
    options: dict[str, Any],
    progress: Progress | None,
) -> list[dict[tuple[str, str], Mapping]]:
    """Mappings of every ordered pair, per fold."""
    order = sorted(table.bodies, key=lambda name: table.bodies[name].kind)  # human to robot is the fitted direction
    pairs = [(a, b) for i, a in enumerate(order) for b in order[i + 1 :]]
    fits: list[dict[tuple[str, str], Mapping]] = [{} for _ in groups]
    for done, (a, b) in enumerate(pairs):
        pair = table.motions.pair(a, b)
        models = fit_many(
            [pair.without_actions(list(group)) for group in groups], method, preset, [seed] * len(groups), **options
        )
        for fold, model in zip(fits, models, strict=True):
            fold[a, b], fold[b, a] = model, model.inverse()
        if progress:
            progress("fit", (done + 1) / len(pairs))
    return fits


def _errors(
    table: _Frames,
    groups: Sequence[NDArray[np.str_]],
    fits: list[dict[tuple[str, str], Mapping]],
    max_hops: int,
    progress: Progress | None,
) -> tuple[dict[tuple[str, str], float], dict[Names, float]]:
    """Training error of every link over arm length, and held-out error of every route [m], means over folds."""
    training: dict[tuple[str, str], list[float]] = {}
    held: dict[Names, list[float]] = {}
    for done, (group, fold) in enumerate(zip(groups, fits, strict=True)):
        rows, seen = table.rows(group, test=True), table.rows(group, test=False)
        for (a, b), link in fold.items():
            error = _error(table, (a, b), link(table.frames[a][seen]), seen)
            training.setdefault((a, b), []).append(error / table.bodies[b].reach)
        arrived: dict[Names, FloatArray] = {(name,): table.frames[name][rows] for name in table.bodies}
        for hop in range(max_hops):
            arrived = _step(fold, arrived)
            for route, mapped in arrived.items():
                held.setdefault(route, []).append(_error(table, route, mapped, rows))
            if progress:
                progress("chains", (done + (hop + 1) / max_hops) / len(groups))
    return {k: float(np.mean(v)) for k, v in training.items()}, {k: float(np.mean(v)) for k, v in held.items()}


def _step(fold: dict[tuple[str, str], Mapping], arrived: dict[Names, FloatArray]) -> dict[Names, FloatArray]:
    """All routes one link longer, with the frames that arrive; each link maps the frames of all its routes at once."""
    longer: dict[Names, FloatArray] = {}
    for (a, b), link in fold.items():
        routes = [route for route in arrived if route[-1] == a and b not in route]
        if routes:
            mapped = link(np.concatenate([arrived[route] for route in routes]))
            longer.update(zip([(*route, b) for route in routes], np.split(mapped, len(routes)), strict=True))
    return longer


def _error(table: _Frames, route: Names, mapped: FloatArray, rows: NDArray[np.intp]) -> float:
    """Mean distance of elbows and wrists [m] on the arms that both ends have."""
    wanted = table.frames[route[-1]][rows]
    return _gap(table.bodies[route[0]], table.bodies[route[-1]], mapped, wanted)


def _gap(source: Embodiment, target: Embodiment, mapped: FloatArray, wanted: FloatArray) -> float:
    arms = [i for i, side in enumerate(target.sides) if side in source.sides] or list(range(len(target.sides)))
    gap = target.arm_points(mapped)[:, arms, 1:] - target.arm_points(wanted)[:, arms, 1:]
    return float(np.linalg.norm(gap, axis=-1).mean())


def _fit_options(preset: str | None, fps: float) -> dict[str, Any]:
    """No error bound, and a lag of the same time at any frame rate."""
    return {} if preset == "paper" else {"lag": max(1, round(_LAG_SECONDS * fps)), "confidence": False}


def _results(
    bodies: dict[str, Embodiment],
    links: dict[str, dict[tuple[str, str], Transferability]],
    alpha: dict[frozenset[str], float],
    training: dict[tuple[str, str], float],
    errors: dict[Names, float],
) -> tuple[RouteResult, ...]:
    results = []
    quality = measured_bodies(training)
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
