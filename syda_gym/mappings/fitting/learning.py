"""What recordings gain: a mapping fitted to all of them, and how wrong it is after one action, two, three, ...

A person who records wants to know whether to go on. So the same recordings are also fitted in parts, every part is
scored on actions that it has not seen, and the unfitted mapping stands beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.fitting.fit import fit, fit_many
from syda_gym.mappings.mapping import Mapping, map_clips
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.motions.clip import PairedMotions

__all__ = ["Judged", "LearningRow", "fit_and_judge", "learning_curve"]

_MOST_COUNTS = 8


@dataclass(frozen=True)
class LearningRow:
    """How wrong a mapping is on actions that it has not seen.

    Attributes:
        actions: how many actions it was fitted on; 0 for the unfitted mapping.
        error: mean landmark error on held-out actions [m].
        worst: the same of the worst action [m].
        gained: how much lower the error is than one row before [m]; 0 in the first row.
    """

    actions: int
    error: float
    worst: float
    gained: float


@dataclass(frozen=True, eq=False)
class Judged:
    """A fitted mapping and what its recordings were worth.

    Attributes:
        mapping: fitted to everything.
        rows: from the unfitted mapping to all actions but the held-out one; the unfitted one alone where there is one
            action, because nothing can be held out then.
        bound: error bound on unseen actions [m], ``None`` with one action.
        advice: what the rows say, in words.
    """

    mapping: CodedMapping
    rows: tuple[LearningRow, ...]
    bound: float | None
    advice: str

    def as_dict(self) -> dict[str, Any]:
        """The figures, JSON-able."""
        return {"rows": [asdict(row) for row in self.rows], "bound": self.bound, "advice": self.advice}


def fit_and_judge(
    pair: PairedMotions,
    method: str = "syda",
    preset: str | None = None,
    *,
    seed: int = 0,
    draws: int = 3,
    progress: Progress | None = None,
    **options: Any,
) -> Judged:
    """Fits a mapping to a pair and measures, action by action held out, what its recordings gained.

    Args:
        pair: paired frames.
        method: as for ``fit``.
        preset: as for ``fit``.
        seed: of fits and draws.
        draws: random choices of the training actions per number of actions and held-out action.
        progress: told the finished fraction.
        **options: as for ``fit``.

    Returns:
        The mapping with its figures.

    Raises:
        OptionError: unknown method, preset or option, no draw.
        MappingError: frames from which nothing can be learnt.
        EmbodimentError: bodies without a common arm.
    """
    mapping = fit(pair, method, preset, seed, **options)
    rows = learning_curve(pair, method, preset, seed=seed, draws=draws, progress=progress, **options)
    bound = None if mapping.confidence is None else mapping.confidence.bound
    return Judged(mapping, tuple(rows), bound, _advice(rows))


def learning_curve(
    pair: PairedMotions,
    method: str = "syda",
    preset: str | None = None,
    *,
    counts: Sequence[int] | None = None,
    seed: int = 0,
    draws: int = 3,
    progress: Progress | None = None,
    **options: Any,
) -> list[LearningRow]:
    """Errors on held-out actions after 0, 1, 2, ... recorded ones.

    Every action is held out in turn and mapped by fits of k of the others, drawn at random.

    Args:
        pair: paired frames.
        method: as for ``fit``.
        preset: as for ``fit``.
        counts: the k; by default all if they are few, otherwise some that grow.
        seed: of fits and draws.
        draws: choices of the k actions per held-out action.
        progress: told the finished fraction.
        **options: as for ``fit``.

    Returns:
        The unfitted mapping's row, then one per k.

    Raises:
        OptionError: no draw, or a k that leaves no action to hold out.
    """
    names = list(pair.action_names)
    if draws < 1:
        raise OptionError(f"draws must be at least 1, got {draws}")
    chosen = _counts(len(names)) if counts is None else sorted(set(counts))
    if any(not 1 <= count < len(names) for count in chosen):
        raise OptionError(f"counts must lie between 1 and {len(names) - 1} with {len(names)} actions, got {chosen}")
    tests = {name: pair.only_actions([name]) for name in names}
    start: Mapping = unfitted(pair.source_body, pair.target_body)
    errors = [[{name: _errors(start, test).mean() for name, test in tests.items()}]]
    for done, count in enumerate(chosen, start=1):
        errors.append(_held_out(pair, tests, count, method, preset, seed, draws, options))
        if progress is not None:
            progress(done / len(chosen))
    rows: list[LearningRow] = []
    weights = np.array([len(test) for test in tests.values()], dtype=np.float64)
    for count, draws_of in zip([0, *chosen], errors, strict=True):
        per_action = np.mean([[one[name] for name in names] for one in draws_of], axis=0)
        error = float(np.average(per_action, weights=weights))
        gained = rows[-1].error - error if rows else 0.0
        rows.append(LearningRow(count, error, float(per_action.max()), gained))
    return rows


def _held_out(
    pair: PairedMotions,
    tests: dict[str, PairedMotions],
    count: int,
    method: str,
    preset: str | None,
    seed: int,
    draws: int,
    options: dict[str, Any],
) -> list[dict[str, float]]:
    """Per draw the mean error of each action, mapped by a fit of ``count`` other actions [m]."""
    names = list(tests)
    draws = draws if count < len(names) - 1 else 1  # all others: there is one choice
    training = []
    for draw in range(draws):
        for number, name in enumerate(names):
            others = [other for other in names if other != name]
            order = np.random.default_rng([seed, count, draw, number]).permutation(len(others))
            training.append(pair.only_actions([others[index] for index in sorted(order[:count])]))
    settings = {**options, "confidence": False} if "confidence" not in options else options
    fitted = iter(fit_many(training, method, preset, [seed] * len(training), **settings))
    return [{name: float(_errors(next(fitted), tests[name]).mean()) for name in names} for _ in range(draws)]


def _errors(mapping: Mapping, test: PairedMotions) -> FloatArray:
    return landmark_error(test.target_body, map_clips(mapping, test), test.target)


def _counts(actions: int) -> list[int]:
    """Every number of training actions, or at most eight that grow."""
    most = actions - 1
    if most <= _MOST_COUNTS:
        return list(range(1, most + 1))
    steps = np.unique(np.round(np.geomspace(1, most, _MOST_COUNTS)).astype(int))
    return [int(step) for step in steps]


def _advice(rows: Sequence[LearningRow]) -> str:
    if len(rows) < 2:
        return "one action: nothing can be held out to judge by; record another one"
    unseen, last = rows[0].error, rows[-1]
    if last.error >= unseen:
        return "the recordings did not help on unseen actions: check their lag and axes with `syda-gym motions check`"
    if last.gained > 0.03 * last.error:
        return f"the last step still gained {1000 * last.gained:.0f} mm: further actions will help"
    return "further actions of this kind will gain little"
