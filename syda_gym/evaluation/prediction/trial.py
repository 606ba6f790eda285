"""Trials: all pairs of some bodies fitted without the actions of a fold, and every chain of them scored on those."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import MotionError
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions
from syda_gym.routes.measured import MOST_TRAINING_FRAMES, landmark_gap

__all__ = ["BedFrames", "Progress", "fit_all", "held_out_errors"]

Progress = Callable[[str, float], None]
Names = tuple[str, ...]

MOST_TEST_FRAMES = 120


@dataclass(frozen=True, eq=False)
class BedFrames:
    """Frames of all bodies at the same instants."""

    motions: Motions
    bodies: dict[str, Embodiment]
    frames: dict[str, FloatArray]
    actions: NDArray[np.str_]

    @classmethod
    def of(cls, motions: Motions, names: Names) -> BedFrames:
        """The takes in which all the named bodies move together.

        Raises:
            MotionError: fewer than three bodies or two actions together.
        """
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
        """The actions."""
        return np.unique(self.actions)

    def rows(self, held: NDArray[np.str_], test: bool) -> NDArray[np.intp]:
        """Rows of the held-out actions, or of the others, evenly thinned to a bearable number."""
        rows = np.flatnonzero(np.isin(self.actions, held) == test)
        most = MOST_TEST_FRAMES if test else MOST_TRAINING_FRAMES
        return rows[:: max(1, -(-len(rows) // most))]


def fit_all(
    table: BedFrames,
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


def held_out_errors(
    table: BedFrames,
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


def _error(table: BedFrames, route: Names, mapped: FloatArray, rows: NDArray[np.intp]) -> float:
    """Mean distance of elbows and wrists [m] on the arms that both ends have."""
    wanted = table.frames[route[-1]][rows]
    return landmark_gap(table.bodies[route[0]], table.bodies[route[-1]], mapped, wanted)
