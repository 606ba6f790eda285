"""The demo's folder: page, plots, picture and film, made from a ``DemoResult``."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from syda_gym.envs.task.options import SUCCESS_ERRORS
from syda_gym.evaluation.chains import name_of
from syda_gym.evaluation.demo.known import without_unknown
from syda_gym.evaluation.demo.playback import _SHOWN_HZ, _liveliest, _stride, _tracks, playback_chain
from syda_gym.evaluation.demo.story import (
    cost_words,
    difference,
    dry_run_table,
    next_steps,
    prediction_plot,
    question,
    shows,
    verdict,
)
from syda_gym.evaluation.drawing import draw, png_bytes, write_png
from syda_gym.evaluation.report import (
    BarPlot,
    Column,
    Headline,
    Picture,
    Playback,
    Report,
    RouteEdge,
    RouteGraph,
    Section,
    Table,
    Text,
    Track,
    track,
    write_report,
)
from syda_gym.evaluation.report.model import Cell
from syda_gym.evaluation.report.plots import bar_svg, standalone
from syda_gym.files import write_json, write_text
from syda_gym.simulation.pictures.video import write_video

if TYPE_CHECKING:
    from syda_gym.evaluation.demo.results import ChainResult, DemoResult

__all__ = ["chain_table", "provenance", "write_demo_report"]

_FILM_FRAMES = 75  # five seconds
_LANDMARKS = {"left": ("L elbow", "L wrist"), "right": ("R elbow", "R wrist")}


def write_demo_report(
    result: DemoResult, folder: Path, *, command: str = "", progress: Callable[[float], None] | None = None
) -> Path:
    """Writes the page and, beside it, the plots (SVG), a picture (PNG), a film (MP4) and all figures (JSON).

    Args:
        result: of ``run_demo``.
        folder: exists.
        command: the command line, for the provenance.
        progress: told the finished fraction.

    Returns:
        The path of the page.
    """
    tell = progress or (lambda done: None)
    landmarks, joints = _landmark_plot(result), _joint_plot(result)
    for plot, name in ((landmarks, "landmarks"), (joints, "joints")):
        write_text(folder / f"{name}.svg", standalone(bar_svg(plot)))
    best = _best_chain(result)
    recording, mapping = best.shown[0]
    tracks = _tracks(recording, mapping)
    reference = track(result.robot, recording.reference[:: _stride(recording)])
    names = [*recording.route[:-1], f"{recording.route[-1]} (simulated)", f"{recording.route[-1]} (recorded)"]
    shown = [*tracks, reference]
    title = f"{best.name}: {recording.motion}, a held-out action"
    middle = _liveliest(tracks[0])
    picture = draw(shown, middle, labels=names, title=title)
    write_png(picture, folder / "side_by_side.png")
    write_video(folder / "chains.mp4", _film(shown, names, title, tell), _SHOWN_HZ)
    sections = [
        Section("Whom to record with whom?", [question(result), dry_run_table(result), _graph(result)]),
        Section(
            "What came of it", [prediction_plot(result), *cost_words(result), chain_table(result), landmarks, joints]
        ),
        Section("Playback", [_playback(result)]),
        *([Section("The residual policy", result.residual.blocks())] if result.residual else []),
        Section(
            "Pictures",
            [
                _regions(result),
                Picture(
                    "Side by side",
                    (folder / "side_by_side.png").read_bytes(),
                    variants=_other_pages(shown, middle, names),
                ),
                Picture(
                    "Film",
                    (folder / "chains.mp4").read_bytes(),
                    "video/mp4",
                    variants={"poster": png_bytes(_still(shown, names, title, middle))},
                ),
            ],
        ),
        Section("What this shows", [Text(line) for line in shows(result)]),
        Section("What to do next with your robot", [Text(line) for line in next_steps(result)]),
    ]
    kind = "synthetic motions, generated from a seed" if result.motions.synthetic else "recorded motions"
    report = Report(
        "A new operator: whom to record with whom?",
        f"{result.motions.name} ({kind}); every figure is of actions that the mappings had not seen",
        _headlines(result, best),
        sections,
        provenance(command, result),
    )
    write_json(folder / "results.json", _results(result))
    return write_report(report, folder)


def chain_table(result: DemoResult) -> Table:
    """Every chain with its figures, then the direct pair and the baselines."""
    contenders = [*result.chains, *([result.direct] if result.direct else []), *result.baselines]
    columns = [
        Column("Chain"),
        Column("T", digits=2, tip="of the chain as a whole, in the dry run"),
        Column("Landmark error", "cm", 1, 100, "robot against recorded motion, interquartile mean over episodes"),
        Column("Mapping alone", "cm", 1, 100, "base command against recorded motion, without motors"),
        Column("Joint error", "deg", 1, 180 / np.pi),
        Column("Success", "%", 0, 100, "episodes with a mean landmark error below 10 cm"),
        Column("Jitter", "mm/frame³", 2, 1000),
        Column("Speed violations", "%", 2, 100, "commands above a joint's speed limit"),
        Column("Limit violations", "%", 2, 100, "joint samples of the raw mapping outside the limits"),
        Column("Self-collision", "%", 1, 100, "frames in which the robot touches itself"),
        Column("Bound holds", "%", 0, 100, "frames whose mapping error lies within the error bound"),
        Column("Latency", "ms", 3, 1000, "one frame through the chain"),
        Column("Episodes"),
    ]
    rows: list[list[Cell]] = [
        [
            f"{chain.name} (if it had been recorded)" if chain is result.direct else chain.name,
            chain.transferability if np.isfinite(chain.transferability) else None,
            chain.figure("landmark_error"),
            chain.figure("mapping_error"),
            chain.figure("joint_error"),
            _mean(chain, "success"),
            _mean(chain, "jitter"),
            _mean(chain, "speed_violations"),
            _mean(chain, "limit_violations"),
            _mean(chain, "self_collisions"),
            _mean(chain, "coverage"),
            chain.seconds_per_frame,
            len(chain.episodes),
        ]
        for chain in contenders
    ]
    errors = [chain.figure("mapping_error").value for chain in contenders]
    best = contenders[int(np.argmin(errors))]
    strong = [contenders.index(best)]
    strong += [i for i, one in enumerate(contenders) if one is not best and not difference(one, best).excludes_zero]
    note = (
        "Intervals are 95 % bootstrap intervals over actions. Marked is the least error of the mapping alone, and what "
        f"cannot be told from it. {verdict(result)}."
    )
    return Table("Every chain as episodes", columns, rows, note, sorted(strong))


def provenance(command: str, result: DemoResult) -> dict[str, str]:
    """What made the numbers."""
    from syda_gym import __version__

    held_out = "; ".join(", ".join(group) for group in result.held_out)
    return {
        "Command": command or "syda_gym.evaluation.demo.run.run_demo",
        "Motions": f"{result.motions.name}, {len(result.motions.takes)} takes",
        "Held-out actions": held_out if len(result.held_out) == 1 else f"each once: {held_out}",
        "Seed": str(result.seed),
        "Models fitted": str(result.models),
        "Versions": f"syda-gym {__version__}, Python {platform.python_version()}, NumPy {np.__version__}",
        "Machine": f"{platform.machine()}, {platform.system()}",
        "Wall time": ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in result.seconds.items()),
    }


def _headlines(result: DemoResult, best: ChainResult) -> list[Headline]:
    error = best.figure("landmark_error")
    chosen = result.chosen
    ties = ", ".join(name_of(other.bodies) for other in chosen.ties)
    foreseen = f"{100 * chosen.error:.1f} cm expected" if chosen.error is not None else f"T {chosen.T:.2f}"
    lines = [
        Headline(
            f"Chosen for {result.cast.operator}, before any fit",
            " > ".join(chosen.bodies),
            foreseen + (f"; tie with {ties}" if ties else ""),
        ),
        Headline(
            f"Landmark error, {best.name}",
            f"{100 * error.value:.1f} cm",
            f"95 % interval {100 * error.low:.1f} to {100 * error.high:.1f} cm, {error.count} unseen episodes; "
            f"{100 * best.figure('mapping_error').value:.1f} cm without motors",
            "good" if error.value < 0.1 else "warn",
        ),
        Headline(
            "Success",
            f"{100 * _mean(best, 'success'):.0f} %",
            f"episodes below {100 * SUCCESS_ERRORS['paired']:.1f} cm of mean landmark error, the base's median",
        ),
    ]
    coverage = _mean(best, "coverage")
    if np.isfinite(coverage):
        held = f"{100 * coverage:.0f} % of frames"
        lines.append(Headline("Error bound holds", held, "asked for 90 %", "good" if coverage >= 0.9 else "warn"))
    if result.residual:
        lines.append(result.residual.headline())
    return lines


def _regions(result: DemoResult) -> Picture:
    """Where the robot can stand in for the first operator, after Fig. 3 of the paper."""
    from syda_gym.routes.pictures import clouds_png

    operator = result.cast.operator
    bodies = result.motions.bodies[operator], result.robot
    png, dark = (clouds_png(*bodies, ground=ground) for ground in ("day", "night"))
    narrow, narrow_dark = (clouds_png(*bodies, width=3.5, ground=ground) for ground in ("day", "night"))
    variants = {"dark": dark, "narrow": narrow, "narrow-dark": narrow_dark}
    return Picture(f"Where {result.robot.name} can move as {operator} does", png, variants=variants)


def _other_pages(shown: Sequence[Track], frame: int, names: Sequence[str]) -> dict[str, bytes]:
    """The bodies side by side for dark pages, and, with letters that can be read there, for phones."""
    wide = png_bytes(draw(shown, frame, labels=names, ground="night"))
    short = [name.partition("(")[2].rstrip(")") or name for name in names]  # "pepper (simulated)" has no room
    narrow, narrow_dark = (
        png_bytes(draw(shown, frame, size=(700, 560), labels=short, ground=ground, letters=25))
        for ground in ("day", "night")
    )
    return {"dark": wide, "narrow": narrow, "narrow-dark": narrow_dark}


def _best_chain(result: DemoResult) -> ChainResult:
    """The chain that was chosen."""
    return next(chain for chain in result.chains if chain.route == result.chosen.bodies)


def _landmark_plot(result: DemoResult) -> BarPlot:
    groups = [name for side in result.robot.sides for name in _LANDMARKS[side]]
    series = {chain.name: [chain.part("landmarks", i) for i in range(len(groups))] for chain in result.chains}
    return BarPlot("Error of each chain at each landmark", "landmark error [cm]", groups, series, 100.0)


def _joint_plot(result: DemoResult) -> BarPlot:
    groups = [_short(name) for name in result.robot.joint_names]
    shown = [chain for chain in result.chains if chain.route == result.chosen.bodies]
    shown += [*([result.direct] if result.direct else []), *result.baselines]
    shown = shown[:4]
    series = {chain.name: [chain.part("joints", i) for i in range(len(groups))] for chain in shown}
    return BarPlot("Error of each chain at each joint", "joint error [degrees]", groups, series, 180 / np.pi)


def _short(joint: str) -> str:
    """``LShoulderPitch`` as ``L sh. pitch``, so that ten joints fit below an axis."""
    words = "".join(f" {c}" if c.isupper() else c for c in joint).split()
    return " ".join(words).replace("Shoulder", "sh.").replace("Elbow", "elb.").lower().replace("l ", "L ", 1).replace(
        "r ", "R ", 1
    ) if words and words[0] in ("L", "R") else joint  # fmt: skip


def _graph(result: DemoResult) -> RouteGraph:
    links = {(link.source, link.target): link for route in result.expected for link in route.links}
    bodies = {body: result.motions.bodies[body].kind for edge in links for body in edge}
    edges = [RouteEdge(a, b, link.T, link.error) for (a, b), link in links.items()]
    note = "Thicker arrows carry a higher T; errors are those expected of the pair alone. The chosen chain is coloured."
    return RouteGraph("Pairs that could be recorded and the chosen chain", bodies, edges, result.chosen.bodies, note)


def _playback(result: DemoResult) -> Playback:
    entries = []
    for chain in (*result.chains, *([result.direct] if result.direct else [])):
        for recording, mapping in chain.shown:
            episode = next(one for one in chain.episodes if one.motion == recording.motion)
            bound = episode.bound if np.isfinite(episode.bound) else None
            entries.append(playback_chain(chain.name, recording, mapping, bound=bound))
    if result.residual:
        entries += result.residual.playback()
    note = (
        "Drag to turn, wheel or pinch to zoom. The ghost is the robot's own recorded motion; the strip shows the mean "
        "landmark error over time and the mapping's error bound."
    )
    return Playback("Operator, intermediates and robot", entries, note)


def _film(tracks: Sequence[Track], names: Sequence[str], title: str, tell: Callable[[float], None]) -> Iterator[Any]:
    count = min(len(tracks[0]), _FILM_FRAMES)
    for frame in range(count):
        tell(frame / count)
        yield _still(tracks, names, title, frame, finer=1)


def _still(tracks: Sequence[Track], names: Sequence[str], title: str, frame: int, finer: int = 2) -> Any:
    """A picture of the film, on a ground that stands on light pages and on dark ones."""
    return draw(tracks, frame, labels=names, title=title, size=(768, 432), finer=finer, ground="dusk")


def _mean(chain: ChainResult, name: str) -> float:
    return float(np.mean([float(getattr(episode, name)) for episode in chain.episodes]))


def _results(result: DemoResult) -> dict[str, Any]:
    return {
        "motions": result.motions.name,
        "seed": result.seed,
        "held_out": [list(group) for group in result.held_out],
        "cast": {"operator": result.cast.operator, "between": list(result.cast.between), "robot": result.cast.robot},
        "expected": [route.as_dict() for route in result.expected],
        "chosen": result.chosen.as_dict(),
        "chains": {chain.name: _played(chain) for chain in result.chains},
        "direct": _played(result.direct) if result.direct else None,
        "baselines": {chain.name: _played(chain) for chain in result.baselines},
        "verdict": verdict(result),
        "shows": shows(result),
        "residual": result.residual.to_dict() if result.residual else None,
    }


def _played(chain: ChainResult) -> dict[str, Any]:
    return {
        "transferability": chain.transferability if np.isfinite(chain.transferability) else None,
        "landmark_error": chain.figure("landmark_error").to_dict(),
        "mapping_error": chain.figure("mapping_error").to_dict(),
        **without_unknown([episode.to_dict() for episode in chain.episodes]),
    }
