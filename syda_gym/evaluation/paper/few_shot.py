"""The paper's promise: a new body needs few recordings, because a chain reaches the robot through a known one.

A new body (the *newcomer*) has k paired actions. Either they are paired with a known body, and a chain leads through
it to the robot, or they are paired with the robot itself. Both are scored on the newcomer's recordings with the robot,
every action unseen by whatever leads into the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from collections.abc import Mapping as Dict
from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments import landmark_error
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.fitting.fit import fit_many
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import Motions, PairedMotions

__all__ = ["COUNTS", "FewShotRow", "few_shot"]

COUNTS = (1, 2, 3, 4, 6)
"""Numbers of paired actions that are tried."""


@dataclass(frozen=True)
class FewShotRow:
    """Chain against direct pair with the same number of paired actions.

    Attributes:
        count: paired actions of the newcomer.
        chain: mean landmark error of the chain [m].
        chain_spread: its standard deviation over draws of the actions [m].
        direct: mean landmark error of the direct pair [m].
        direct_spread: its standard deviation over draws [m].
        geometric: the direct pair again, of which a rotation alone is learned [m].
        geometric_spread: its standard deviation over draws [m].
    """

    count: int
    chain: float
    chain_spread: float
    direct: float
    direct_spread: float
    geometric: float
    geometric_spread: float


def few_shot(
    motions: Motions,
    newcomer: str,
    known: str,
    robot: str,
    *,
    draws: int = 10,
    counts: Sequence[int] = COUNTS,
    progress: Callable[[float], None] | None = None,
) -> list[FewShotRow]:
    """Compares the chain newcomer > known > robot with the direct pair newcomer > robot.

    The chain's link into the robot is fitted to all of the known body's recordings except the scored action; its hop is
    fitted to k actions of newcomer and known body. The direct pair is fitted to k actions, none of them the scored one:
    once by the ``general`` preset as the chain is, whose geometric prior makes it the fair rival, and once as geometry
    alone, after a rotation that is fitted to the same actions.

    Args:
        motions: with the three pairs.
        newcomer: who has few recordings.
        known: who has many.
        robot: where both lead.
        draws: random choices of the k actions, each with a seed of its own.
        counts: the k to try; those beyond the number of recorded actions are left out.
        progress: told the finished fraction.

    Returns:
        One row per k.

    Raises:
        OptionError: no draw.
        MotionError: a pair was never recorded.
    """
    if draws < 1:
        raise OptionError(f"draws must be at least 1, got {draws}")
    end, hop_pair, link_pair = (
        motions.pair(newcomer, robot),
        motions.pair(newcomer, known),
        motions.pair(known, robot),
    )
    actions = [name for name in end.action_names if name in link_pair.action_names]
    links = dict(
        zip(actions, fit_many([link_pair.without_actions([name]) for name in actions], confidence=False), strict=True)
    )
    tests = {name: end.only_actions([name]) for name in actions}
    most = min(len(hop_pair.action_names), len(end.action_names) - 1)
    rows = []
    tried = [k for k in counts if k <= most]
    for place, count in enumerate(tried):
        if progress is not None:
            progress(place / len(tried))
        chains = _chain_errors(hop_pair, links, tests, count, draws)
        direct = _direct_errors(end, tests, count, draws, "syda")
        geometric = _direct_errors(end, tests, count, draws, "geometric")
        figures = [float(value) for errors in (chains, direct, geometric) for value in (errors.mean(), errors.std())]
        rows.append(FewShotRow(count, *figures))
    return rows


def _chain_errors(
    hop_pair: PairedMotions,
    links: dict[str, CodedMapping],
    tests: dict[str, PairedMotions],
    count: int,
    draws: int,
) -> FloatArray:
    """Mean error of the chain per draw, ``(draws,)`` [m]."""
    chosen = [_draw(hop_pair.action_names, count, draw) for draw in range(draws)]
    hops = fit_many([hop_pair.only_actions(names) for names in chosen], seeds=range(draws), confidence=False)
    return np.array([_score({name: hop >> link for name, link in links.items()}, tests) for hop in hops])


def _direct_errors(
    end: PairedMotions, tests: dict[str, PairedMotions], count: int, draws: int, method: str
) -> FloatArray:
    """Mean error of the direct pair per draw, ``(draws,)`` [m]."""
    pairs, seeds = [], []
    for draw in range(draws):
        for number, name in enumerate(tests):
            others = [other for other in end.action_names if other != name]
            pairs.append(end.only_actions(_draw(others, count, draw, number)))
            seeds.append(draw)
    fitted = iter(fit_many(pairs, method, seeds=seeds, confidence=False))
    return np.array([_score({name: next(fitted) for name in tests}, tests) for _ in range(draws)])


def _draw(names: Sequence[str], count: int, *seed: int) -> list[str]:
    """A random choice of actions, the same for the same seed."""
    rng = np.random.default_rng([count, *seed])
    return [names[index] for index in sorted(rng.choice(len(names), count, replace=False))]


def _score(mappings: Dict[str, Mapping], tests: dict[str, PairedMotions]) -> float:
    """Mean landmark error over all rows, each action by its own mapping [m]."""
    errors = [
        landmark_error(test.target_body, mappings[name](test.source), test.target) for name, test in tests.items()
    ]
    return float(np.concatenate(errors).mean())
