"""The demo's argument: what was predicted, what came, what a wrong choice would have cost, and what to do next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from syda_gym.evaluation.chains import name_of
from syda_gym.evaluation.demo.cast import traits
from syda_gym.evaluation.report import BarPlot, Column, Table, Text
from syda_gym.evaluation.report.model import Block, Cell
from syda_gym.evaluation.statistics import Estimate, clustered_estimate, spearman
from syda_gym.routes.routing import models_chained, models_direct

if TYPE_CHECKING:
    from syda_gym.evaluation.demo.results import ChainResult, DemoResult

__all__ = ["cost_words", "difference", "dry_run_table", "next_steps", "prediction_plot", "question", "shows", "verdict"]


def question(result: DemoResult) -> Text:
    """What is asked."""
    cast = result.cast
    if not cast.between:
        return Text(
            f"{cast.operator} was recorded with {cast.robot} alone: there is no chain to choose, and the direct pair "
            "is played."
        )
    known = ", ".join(map(traits, cast.between))
    return Text(
        f"A new operator, {cast.operator}, has never been recorded with {cast.robot}. One session with one of "
        f"{len(cast.between)} bodies that have been, would do: {known}. With whom? Asked before "
        "anything is fitted: every body imitates the operator's planned motion on paper, within its joint limits and "
        "speeds."
    )


def dry_run_table(result: DemoResult) -> Table:
    """What the dry run expects of every chain, best first."""
    columns = [
        Column("Chain"),
        Column("Expected error", "cm", 1, 100, "on actions that no fit has seen, with its standard error over actions"),
        Column("T", digits=2, tip="alpha C (the form of Eq. 10), of the chain as a whole"),
        Column("alpha", digits=2, tip="what noise and imprecision leave of C, least along the chain"),
        Column("Verdict"),
    ]
    ranked = sorted(result.expected, key=lambda route: -route.score)
    ties = {other.bodies for other in result.chosen.ties}
    rows: list[list[Cell]] = []
    for route in ranked:
        if route.error is None:
            rows.append([name_of(route.bodies), None, route.T, None, route.note or "not rehearsed"])
            continue
        spread = route.standard_error or 0.0
        said = "chosen" if route.bodies == result.chosen.bodies else "tie" if route.bodies in ties else "worse"
        error = Estimate(route.error, route.error - spread, route.error + spread)
        rows.append(
            [name_of(route.bodies), error, route.T, min((link.alpha for link in route.links), default=1.0), said]
        )
    strong = [i for i, route in enumerate(ranked) if route.bodies == result.chosen.bodies or route.bodies in ties]
    note = "A tie is a margin below its standard error over actions; what ties with the chosen chain is marked as well."
    return Table("Dry run of every chain, before any fit", columns, rows, note, strong)


def prediction_plot(result: DemoResult) -> BarPlot:
    """Predicted beside measured error of every chain, the chosen one marked."""
    ranked = sorted((r for r in result.expected if r.error is not None), key=lambda route: -route.score)
    by_route = {chain.route: chain for chain in result.chains}
    groups, predicted, measured = [], [], []
    for route in ranked:
        between = " > ".join(route.bodies[1:-1]) or "direct"
        groups.append(f"{between} (chosen)" if route.bodies == result.chosen.bodies else between)
        error, spread = route.error or 0.0, 1.96 * (route.standard_error or 0.0)
        predicted.append(Estimate(error, error - spread, error + spread))
        measured.append(by_route[route.bodies].figure("mapping_error"))
    return BarPlot(
        "Predicted and measured error by the body between",
        "landmark error on unseen actions [cm]",
        groups,
        {"predicted by the dry run": predicted, "measured on fitted chains": measured},
        100.0,
        "Measured is the mapping alone, without motors, as in the dry run; 95 % intervals over actions.",
    )


def difference(one: ChainResult, other: ChainResult, figure: str = "mapping_error") -> Estimate:
    """Mean paired difference of two contenders over the same episodes, interval over actions [m]."""
    theirs = {episode.motion: float(getattr(episode, figure)) for episode in other.episodes}
    shared = [episode for episode in one.episodes if episode.motion in theirs]
    gaps = [float(getattr(episode, figure)) - theirs[episode.motion] for episode in shared]
    return clustered_estimate(gaps, [episode.action for episode in shared], statistic=np.mean)


def cost_words(result: DemoResult) -> list[Block]:
    """What a wrong choice would have cost, and what the direct pair would have needed and given."""
    chosen, others = _chosen(result), [c for c in result.chains if c.route != result.chosen.bodies]
    blocks: list[Block] = []
    if others:
        worst = max(others, key=lambda chain: chain.figure("mapping_error").value)
        gap = difference(worst, chosen)
        blocks.append(Text(f"The wrong choice, {worst.name}, would have cost {_cm(gap)} more than {chosen.name}."))
    if len(result.chains) > 3:
        expected = [route.error or np.nan for route in result.expected]
        came = {chain.route: chain.figure("mapping_error").value for chain in result.chains}
        rank = spearman(expected, [came[route.bodies] for route in result.expected])
        blocks.append(
            Text(
                f"Rank correlation of predicted with measured error over these {len(expected)} chains: "
                f"{rank.value:+.2f}. "
                "Four chains are an example; docs/study-transferability.md has the study, its ceiling and its limits."
            )
        )
    cast = result.cast
    if cast.between and result.direct is not None:
        people = [n for n in (cast.operator, *cast.between) if result.motions.bodies[n].kind == "human"]
        robots = [n for n in (*cast.between, cast.robot) if result.motions.bodies[n].kind == "robot"]
        direct, chained = models_direct(len(people), len(robots)), models_chained(len(people), len(robots))
        gap = difference(chosen, result.direct)
        blocks.append(
            Text(
                f"A direct pair would have needed {cast.operator} to be recorded with every robot: {direct} models for "
                f"these {len(people)} people and {len(robots)} robots (Eq. 5) against {chained} with chains (Eq. 6). "
                f"Had it been recorded, {name_of(cast.direct)} would have "
                f"{100 * result.direct.figure('mapping_error').value:.1f} cm; "
                f"the chosen chain minus that is {_cm(gap)}."
            )
        )
    return blocks


def verdict(result: DemoResult) -> str:
    """The chosen chain against the best rival, not against the weakest."""
    chosen = _chosen(result)
    if not result.baselines:
        return "no baseline was played"
    rival = min(result.baselines, key=lambda chain: float(chain.figure("mapping_error").value))
    gap = difference(chosen, rival)
    if not gap.excludes_zero:
        return f"{chosen.name} against the best rival, {rival.name}: no difference shown ({_cm(gap)})"
    word = "better" if gap.value < 0 else "worse"
    return f"{chosen.name} is {word} than the best rival, {rival.name}: {_cm(gap)}"


def shows(result: DemoResult) -> list[str]:
    """What this shows, in three lines."""
    chosen = _chosen(result)
    others = [chain for chain in result.chains if chain.route != chosen.route]
    best = min(result.chains, key=lambda chain: float(chain.figure("mapping_error").value))
    if others:
        worst = max(others, key=lambda chain: chain.figure("mapping_error").value)
        lost = chosen.figure("mapping_error").value / best.figure("mapping_error").value - 1.0
        first = (
            f"Before any recording the dry run chose {chosen.name}; of the {len(result.chains)} chains it came "
            + ("out best" if best is chosen else f"{100 * lost:.0f} % behind the best, {best.name}")
            + f", and {worst.name} costs {_cm(difference(worst, chosen))} more."
        )
    else:
        first = f"There was one way to go, {chosen.name}, with {100 * chosen.figure('mapping_error').value:.1f} cm."
    kind = (
        "These motions are synthetic: they show how methods compare, not how well a person would be followed."
        if result.motions.synthetic
        else "These motions are recordings; intervals are over the actions in them, not over people."
    )
    return [first, verdict(result) + ".", kind]


def next_steps(result: DemoResult) -> list[str]:
    """What to do next with one's own robot, in three lines."""
    return [
        "syda-gym robot add my_robot.urdf, then syda-gym route --operator adult --robot my_robot --pair ... --suggest: "
        "whom to record with whom.",
        "syda-gym record --robot my_robot, then syda-gym fit: a few minutes of you and it; unfitted serves until then.",
        "syda-gym teleop --source camera --robot my_robot --view: drive it, in simulation first.",
    ]


def _chosen(result: DemoResult) -> ChainResult:
    return next(chain for chain in result.chains if chain.route == result.chosen.bodies)


def _cm(gap: Estimate) -> str:
    return f"{100 * gap.value:+.1f} cm (95 % interval {100 * gap.low:+.1f} to {100 * gap.high:+.1f})"
