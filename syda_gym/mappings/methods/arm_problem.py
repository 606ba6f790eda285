"""ArmProblem: a pair's frames as codes per arm, with the lag removed: where all methods start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import MappingError
from syda_gym.files import fingerprint
from syda_gym.mappings.card import card_of
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.coding.arm_coders import HumanArmCoder, RobotArmCoder, arm_coder, shared_arms
from syda_gym.mappings.coding.window_coder import WindowCoder, encode_clips
from syda_gym.mappings.confidence import Confidence, action_maximum, fit_confidence, gain
from syda_gym.mappings.mapping import map_clips
from syda_gym.mappings.methods.jobs import FitJob
from syda_gym.mappings.methods.lag import estimate_lags, shift_targets
from syda_gym.mappings.models.heads import HeadedRegressor, fit_head
from syda_gym.mappings.models.regressors import Regressor
from syda_gym.motions.clip import PairedMotions

__all__ = ["ArmCoder", "ArmProblem", "Coding", "RowFitter", "action_groups", "fit_problems", "thinned", "upper_share"]

ArmCoder = HumanArmCoder | RobotArmCoder | WindowCoder
RowFitter = Callable[[Sequence["ArmProblem"]], list[Regressor]]
"""Fits one regressor between the main codes of each problem, all together where that is faster."""

_MAX_HELD_OUT = 10
_MAX_ROWS = 8000


@dataclass(frozen=True)
class Coding:
    """How frames become codes.

    Attributes:
        max_lag: largest lag searched for [frames].
        placed: whether a human's code says where the shoulder is.
        window: past frames beside each frame of a human source.
    """

    max_lag: int = 0
    placed: bool = False
    window: int = 0


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """What a regressor is fitted to.

    Attributes:
        pair: the training frames.
        seed: of the fit.
        source_coder: calibrated to the training frames.
        target_coder: calibrated to the training frames.
        source: codes ``(N, K, D)``.
        target: codes ``(N, K, E)``, lag removed.
        unshifted: the target's codes as recorded, for the way back: there the lag of a mimicking person is no error of
            the mapping that could be told from the frames.
        lags: recording to shift [frames].
    """

    pair: PairedMotions
    seed: int
    source_coder: ArmCoder
    target_coder: ArmCoder
    source: FloatArray
    target: FloatArray
    unshifted: FloatArray
    lags: dict[str, int]

    @classmethod
    def build(cls, pair: PairedMotions, seed: int, coding: Coding) -> ArmProblem:
        """Calibrates, encodes, and removes the lag of a human who mimicked a robot.

        Raises:
            MappingError: a window over something else than a human who leads a robot.
        """
        mimicry = pair.source_body.kind == "human" and pair.target_body.kind == "robot"
        if coding.window and not mimicry:
            raise MappingError(
                f"window={coding.window}: a window looks back over a human's frames on the way to a robot; {pair!r} "
                "maps single frames, leave window out"
            )
        sides = shared_arms(pair.source_body, pair.target_body)
        source_coder: ArmCoder = arm_coder(pair.source_body, pair.source, sides[0], coding.placed)
        target_coder = arm_coder(pair.target_body, pair.target, sides[1], coding.placed)
        if coding.window and isinstance(source_coder, HumanArmCoder):
            source_coder = WindowCoder.around(source_coder, coding.window)
        source, target = encode_clips(source_coder, pair), target_coder.encode(pair.target)
        lags = estimate_lags(pair, source, target[..., :6], coding.max_lag if mimicry else 0)
        shifted = shift_targets(pair, target, lags)
        return cls(pair, seed, source_coder, target_coder, source, shifted, target, lags)

    @property
    def main(self) -> tuple[FloatArray, FloatArray]:
        """Codes without extra joints, ``(N, K, D)`` and ``(N, K, E)``."""
        return self.source[..., : main_width(self.source_coder)], self.target[..., : main_width(self.target_coder)]

    @property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        """Main codes arm by arm, ``(N * K, D)`` and ``(N * K, E)``; thinned if very many."""
        x, y = self.main
        return thinned(x), thinned(y)

    @property
    def main_back(self) -> tuple[FloatArray, FloatArray]:
        """Codes for the way back, ``(N, K, E)`` as recorded and ``(N, K, D)``; of a window the current frame alone."""
        x = self.main[0]
        if isinstance(self.source_coder, WindowCoder):
            x = x[..., -self.source_coder.inner.width :]
        return self.unshifted[..., : main_width(self.target_coder)], x


def main_width(coder: ArmCoder) -> int:
    """Width of a code without the extra joints of a robot."""
    return 6 if isinstance(coder, RobotArmCoder) else coder.width


def thinned(codes: FloatArray, most: int = _MAX_ROWS) -> FloatArray:
    """Codes ``(N, K, D)`` arm by arm ``(rows, D)``, every so manieth frame if there are more than ``most`` rows."""
    rows = codes[:: -(-codes.shape[0] * codes.shape[1] // most)]
    return rows.reshape(-1, rows.shape[-1])


def upper_share(coder: ArmCoder) -> float:
    """The upper arm's share of a human's arm length, 0 for a robot, whose code holds directions alone."""
    human = coder.inner if isinstance(coder, WindowCoder) else coder
    return float(human.lengths[0] / human.lengths.sum()) if isinstance(human, HumanArmCoder) else 0.0


def fit_problems(
    jobs: Sequence[FitJob],
    method: str,
    fitter: RowFitter,
    *,
    coding: Coding,
    confidence: bool,
) -> list[CodedMapping]:
    """Fits mappings per arm, each with extra-joint heads and, if wanted, a confidence both ways.

    Args:
        jobs: what to fit.
        method: name for the card.
        fitter: fits the regressors.
        coding: how frames become codes.
        confidence: also hold actions out, for the error bound.

    Returns:
        One mapping per job.
    """
    # Fold a without action b is fold b without action a: the same frames, built and fitted once.
    problems = _built([(job.pair, job.seed) for job in jobs], coding)
    groups = [action_groups(problem.pair) if confidence else [] for problem in problems]
    trained = [
        (problem.pair.without_actions(actions), problem.seed)
        for problem, several in zip(problems, groups, strict=True)
        for actions in several
    ]
    held_out = _built(trained, coding, problems)
    distinct = {id(problem): problem for problem in (*problems, *held_out)}
    regressors = dict(zip(distinct, fitter(list(distinct.values())), strict=True))
    parts = {key: assemble(problem, regressors[key]) for key, problem in distinct.items()}
    trials = iter(parts[id(problem)] for problem in held_out)
    result = []
    for job, problem, group in zip(jobs, problems, groups, strict=True):
        card = card_of(job.pair, method, job.preset, job.seed, job.options)
        if not group:
            why = "one action" if confidence else "none was asked for"
            card = replace(card, note=f"no error bound: {why}")
        mapping = CodedMapping(card, *parts[id(problem)])
        if confidence:
            tests = [(job.pair.only_actions(actions), CodedMapping(card, *next(trials))) for actions in group]
            mapping.confidence, mapping.confidence_back = _confidences(mapping, problem, tests)
        result.append(mapping)
    return result


def _built(
    wanted: Sequence[tuple[PairedMotions, int]], coding: Coding, known: Sequence[ArmProblem] = ()
) -> list[ArmProblem]:
    """Problems for pairs and seeds; equal frames are built once, and with equal seeds they are one problem."""
    by_frames = {_identity(problem.pair): problem for problem in known}
    distinct = {(_identity(problem.pair), problem.seed): problem for problem in known}
    result = []
    for pair, seed in wanted:
        frames = _identity(pair)
        if frames not in by_frames:
            by_frames[frames] = ArmProblem.build(pair, seed, coding)
        if (frames, seed) not in distinct:
            distinct[frames, seed] = replace(by_frames[frames], seed=seed)
        result.append(distinct[frames, seed])
    return result


def _identity(pair: PairedMotions) -> str:
    """A text that two pairs share if a fit cannot tell them apart."""
    return fingerprint(pair.fingerprint, "|".join(pair.recordings.tolist()), pair.mirrored.tobytes())


def assemble(problem: ArmProblem, regressor: Regressor) -> tuple[ArmCoder, ArmCoder, Regressor]:
    """Coders and regressor of a mapping; extra joints get heads of their own."""
    a, b = problem.source_coder, problem.target_coder
    extras_a, extras_b = a.width - main_width(a), b.width - main_width(b)
    if not extras_a and not extras_b:
        return a, b, regressor
    head = fit_head(problem.source, problem.target[..., main_width(b) :])
    back = fit_head(problem.target, problem.source[..., main_width(a) :])
    return a, b, HeadedRegressor(regressor, head, back, main_width(a), main_width(b))


def action_groups(pair: PairedMotions) -> list[list[str]]:
    """Actions to hold out together: one by one, or in at most ten groups."""
    names = list(pair.action_names)
    if len(names) < 2:
        return []
    count = min(len(names), _MAX_HELD_OUT)
    return [names[start::count] for start in range(count)]


def _confidences(
    mapping: CodedMapping, problem: ArmProblem, tests: list[tuple[PairedMotions, CodedMapping]]
) -> tuple[Confidence, Confidence | None]:
    forward = _confidence(mapping, problem.pair, tests)
    try:
        back = mapping.inverse()
        turned = [(pair.reversed(), trial.inverse()) for pair, trial in tests]
    except MappingError:  # this model has no inverse, hence no confidence for it
        return forward, None
    return forward, _confidence(back, problem.pair.reversed(), turned)


def _confidence(
    mapping: CodedMapping, pair: PairedMotions, tests: list[tuple[PairedMotions, CodedMapping]]
) -> Confidence:
    bound = None
    if tests:
        errors = [
            landmark_error(mapping.target, map_clips(trial, test), test.target).mean(axis=1) for test, trial in tests
        ]
        bound = action_maximum(np.concatenate(errors), np.concatenate([test.actions for test, _ in tests]))
    rows = np.linspace(0, len(pair) - 1, min(len(pair), 400)).astype(int)
    mapped = map_clips(mapping, pair)[rows] if mapping.window else mapping(pair.source[rows])
    enlargement = gain(mapping.source, mapping.target, pair.source[rows], mapped)
    return fit_confidence(encode_clips(mapping.source_coder, pair), pair.actions, bound, enlargement)
