"""Turns a finished study (scripts/study_agents.py) into docs/study-agents-tables.md, agents.json and the pictures.

    python scripts/report_agents.py --study study --out docs
    python scripts/report_agents.py --study study --validation    # only J on the validation motions, before the test

Tables hold interquartile means over all episodes and seeds of a condition, with bootstrap intervals that redraw
episodes and seeds within their action. Bars are ratios of means, with the interval over motions in brackets and, where
there are several seeds, the least and the largest ratio of a seed in parentheses. A policy on a predictor is compared
with the predictor of the same seed. The opponent of a bar is the rival with the least J on the test motions themselves,
a choice that favours the rivals. Nothing here looks at anything but the stored figures.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from syda_gym.evaluation.statistics import estimate, iqm, probability_of_improvement
from syda_gym.files import read_json, write_json, write_text
from syda_gym.look import plot_theme

matplotlib.use("Agg")

CELLS = (
    ("lag", "test"),
    ("noise", "test"),
    ("latency", "test"),
    ("noise-latency", "test"),
    ("full", "test"),
    ("full", "harsh"),
)
RIVALS = ("base", "lead", "adaptive_lead", "one_euro", "one_euro_lead", "ema_lead", "kalman")
STACK_BARS = {
    ("lag", "test"): 1.0,
    ("noise", "test"): 1.0,
    ("latency", "test"): 0.93,
    ("noise-latency", "test"): 0.98,
    ("full", "test"): 0.98,
    ("full", "harsh"): 1.0,
}
COLUMNS = 4  # of learning curves
Rows = Mapping[str, Sequence[Mapping[str, Any]]]


class Cell:
    """Figures of one cell: per condition a matrix of seeds and test episodes."""

    def __init__(self, study: Path, name: str, level: str) -> None:
        self.name, self.level = name, level
        rows: Rows = read_json(study / name / f"test-{level}.json")
        grouped: dict[str, list[Sequence[Mapping[str, Any]]]] = defaultdict(list)
        self.labels: dict[str, list[str]] = defaultdict(list)
        for label, found in rows.items():
            name, seed = label.rsplit("-", 1) if label[-1].isdigit() else (label, "")
            grouped[name].append(found)
            self.labels[name].append(seed)
        self.runs = grouped
        self.seeds = {condition: len(found) for condition, found in grouped.items()}
        first = next(iter(rows.values()))
        self.actions = [str(row["action"]) for row in first]
        self.feasible = np.array([bool(row["feasible"]) for row in first])
        self.best_rival = min((*RIVALS, "full_kalman"), key=lambda rival: float(self.values(rival, "J").mean()))

    def values(self, condition: str, figure: str) -> NDArray[np.float64]:
        """One value per seed and episode, ``(seeds, episodes)``."""
        return np.array([[float(row[figure]) for row in run] for run in self.runs[condition]])

    def strata(self, condition: str) -> list[str]:
        """The action of every value of ``values``, flattened."""
        return self.actions * self.seeds[condition]

    def conditions(self) -> list[str]:
        """Rivals first, then what was learned."""
        return [*RIVALS, *sorted(name for name in self.runs if name not in RIVALS)]


def table(cell: Cell) -> list[str]:
    """Markdown table of one cell."""
    lines = [
        f"### {cell.name}, level {cell.level}",
        "",
        f"{len(cell.actions)} episodes of {len(set(cell.actions))} actions; best rival: `{cell.best_rival}`.",
        "",
        "| agent | seeds | landmark error [mm] | jitter [mm/frame³] | J | 95 % of J | beats the rival |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, entry in summary(cell).items():
        lines.append(
            f"| {name} | {entry['seeds']} | {entry['landmark_mm']:.2f} | {entry['jitter']:.2f} | {entry['J']:.2f} | "
            f"{entry['J_low']:.2f} to {entry['J_high']:.2f} | {entry['beats_rival']:.2f} |"
        )
    return [*lines, ""]


def summary(cell: Cell) -> dict[str, dict[str, float]]:
    """The table of one cell as plain data."""
    rival = cell.values(cell.best_rival, "J").ravel()
    result: dict[str, dict[str, float]] = {}
    for condition in cell.conditions():
        strata = cell.strata(condition)
        values = cell.values(condition, "J").ravel()
        interval = estimate(values, strata)
        entry = {figure: iqm(cell.values(condition, figure)) for figure in ("landmark_mm", "joint_mrad", "jitter")}
        entry |= {"J": interval.value, "J_low": interval.low, "J_high": interval.high}
        entry["beats_rival"] = probability_of_improvement(values, rival, strata, cell.strata(cell.best_rival)).value
        entry["seeds"] = cell.seeds[condition]
        result[condition] = entry
    return result


class Ratio:
    """A condition's mean over a baseline's, on all episodes or on some of them, over all seeds and seed by seed.

    ``low`` and ``high`` are of the interval that redraws motions, with the seeds as they are.
    """

    def __init__(
        self, cell: Cell, condition: str, baseline: str, figure: str, which: NDArray[np.bool_] | None = None
    ) -> None:
        chosen = np.ones(len(cell.actions), dtype=bool) if which is None else which
        below = cell.values(baseline, figure)[:, chosen].mean(axis=1)
        known = dict(zip(cell.labels[baseline], below, strict=True))
        seeds = cell.labels[condition]
        # What was trained upon the baseline's own seeds is compared with these, seed by seed.
        below = np.array([known[seed] for seed in seeds]) if set(seeds) <= set(known) else below.mean()
        self.seeds = cell.values(condition, figure)[:, chosen].mean(axis=1) / below
        self.mean = float(self.seeds.mean())
        used = [seed for seed in cell.labels[baseline] if seed in seeds] or cell.labels[baseline]
        rows = [cell.labels[baseline].index(seed) for seed in used]
        mine = cell.values(condition, figure)[:, chosen].mean(axis=0)
        theirs = cell.values(baseline, figure)[rows][:, chosen].mean(axis=0)
        drawn = np.random.default_rng(0).integers(len(mine), size=(2000, len(mine)))
        self.low, self.high = np.quantile(mine[drawn].sum(axis=1) / theirs[drawn].sum(axis=1), [0.025, 0.975])

    def __str__(self) -> str:
        text = f"{self.mean:.3f} [{self.low:.3f} to {self.high:.3f}]"
        if len(self.seeds) == 1:
            return text
        return f"{text} ({self.seeds.min():.3f} to {self.seeds.max():.3f})"


def bars(cells: Mapping[tuple[str, str], Cell]) -> list[str]:
    """The bars of the study, each with what was measured and whether it holds."""
    rows = [_row("bar", "asked", "measured", "held"), "|---|---|---|---|"]
    rows += _lag_bars(cells["lag", "test"])
    rows += _residual_bars(cells)
    rows += _stack_bars(cells)
    for name, limit in (("noise", 0.95), ("noise-latency", 0.96), ("full", 0.95)):
        rows += _predictor_bars(cells[name, "test"], limit)
    late = cells["latency", "test"]
    if "predictor" in late.runs:
        error, jitter = (Ratio(late, "predictor", late.best_rival, f) for f in ("landmark_mm", "jitter"))
        held = error.mean <= 0.85 and jitter.mean <= 1.0
        words = f"latency: predictor, error at equal or lower jitter than `{late.best_rival}`"
        rows.append(_row(words, "<= 0.85 at <= 1.00", f"{error} at {jitter}", _verdict(held)))
    harsh = cells["full", "harsh"]
    if "predictor" in harsh.runs:
        j = Ratio(harsh, "predictor", harsh.best_rival, "J")
        rows.append(
            _row(f"full, harsh: predictor, J against `{harsh.best_rival}`", "<= 1.00", str(j), _verdict(j.mean <= 1.0))
        )
    return [*rows, ""]


def _lag_bars(lag: Cell) -> list[str]:
    rows = []
    for words, which in (("all motions", None), ("motions within the speed limits", lag.feasible)):
        if which is not None and which.all():
            continue
        recovered = 1.0 - Ratio(lag, "lead", "base", "landmark_mm", which).mean
        rows.append(
            _row(f"lag: the lead recovers the base's landmark error, {words}", ">= 0.90", f"{recovered:.3f}",
                 _verdict(recovered >= 0.90))
        )  # fmt: skip
    return rows


def _residual_bars(cells: Mapping[tuple[str, str], Cell]) -> list[str]:
    """The policy on the tuned Kalman filter: what it gains where it was trained, and whether it harms elsewhere."""
    rows = []
    for (name, level), cell in cells.items():
        if "residual" not in cell.runs:
            continue
        j, error, jitter = (Ratio(cell, "residual", "full_kalman", f) for f in ("J", "landmark_mm", "jitter"))
        if (name, level) == ("full", "test"):
            words = "full: residual on the tuned Kalman filter, J against the filter"
            rows.append(_row(words, "<= 0.95", str(j), _verdict(j.mean <= 0.95)))
        else:
            held = error.mean <= 1.05 and jitter.mean <= 1.2
            rows.append(
                _row(f"{name}, {level}: the same residual does no harm (J {j.mean:.3f})",
                     "error <= 1.05, jitter <= 1.20", f"{error}, {jitter}", _verdict(held))
            )  # fmt: skip
    return rows


def _stack_bars(cells: Mapping[tuple[str, str], Cell]) -> list[str]:
    """The default stack, a policy on the predictor, against the predictor; then who is the best row of each cell."""
    rows = []
    for (name, level), cell in cells.items():
        if "stack" not in cell.runs:
            continue
        limit = STACK_BARS[name, level]
        j, jitter = (Ratio(cell, "stack", "predictor", figure) for figure in ("J", "jitter"))
        held = j.mean <= limit and jitter.mean <= 1.0
        words = f"{name}, {level}: predictor + residual against the predictor, J and jitter"
        rows.append(_row(words, f"<= {limit:.2f}, <= 1.00", f"{j}, {jitter}", _verdict(held)))
        best = min(cell.conditions(), key=lambda condition, cell=cell: float(cell.values(condition, "J").mean()))
        words = f"{name}, {level}: predictor + residual is the best row"
        rows.append(_row(words, "it is", f"`{best}`", _verdict(best.endswith("stack"))))
    return rows


def _predictor_bars(cell: Cell, limit: float) -> list[str]:
    if "predictor" not in cell.runs:
        return []
    j, error, jitter = (Ratio(cell, "predictor", cell.best_rival, f) for f in ("J", "landmark_mm", "jitter"))
    held = error.mean <= 1.02 and jitter.mean <= 0.80
    return [
        _row(f"{cell.name}: predictor, J against `{cell.best_rival}`", f"<= {limit}", str(j),
             _verdict(j.mean <= limit)),
        _row(f"{cell.name}: its error and jitter", "<= 1.02, <= 0.80", f"{error}, {jitter}", _verdict(held)),
    ]  # fmt: skip


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _verdict(held: bool) -> str:
    return "yes" if held else "**no**"


def curve_picture(cells: Mapping[tuple[str, str], Cell], path: Path) -> None:
    """Error against jitter with every method on it, one panel a cell."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(13, 8.6))
    every = list(dict.fromkeys(name for cell in cells.values() for name in cell.conditions()))
    for axis, cell in zip(axes.ravel(), cells.values(), strict=True):
        for name in cell.conditions():
            x, y = iqm(cell.values(name, "jitter")), iqm(cell.values(name, "landmark_mm"))
            learned = any(kind in name for kind in ("predictor", "residual", "stack"))
            colour = plt.cm.tab20(every.index(name) % 20)
            axis.scatter(
                x, y, s=90 if learned else 50, marker="*" if learned else "o", color=colour, zorder=3, label=name
            )
        axis.set_title(f"{cell.name} ({cell.level})")
        axis.set_xlabel("jitter [mm/frame³]")
        axis.set_ylabel("landmark error [mm]")
        axis.grid(alpha=0.3)
    found = {
        label: handle for axis in axes.ravel() for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend([found[name] for name in every], every, loc="lower center", ncols=(len(every) + 1) // 2, fontsize=8)
    figure.tight_layout(rect=(0.0, 0.06, 1.0, 1.0))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def learning_picture(study: Path, path: Path) -> None:
    """Validation objective over training, one line a seed."""
    import matplotlib.pyplot as plt

    groups: dict[str, list[list[float]]] = defaultdict(list)
    for file in sorted(study.glob("*/*-[0-9].json")):
        curve = read_json(file)["figures"]["validation_curve"]
        groups[f"{file.parent.name}: {file.stem[:-2]}"].append([float(point["J"]) for point in curve])
    rows = max(-(-len(groups) // COLUMNS), 1)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.2 * COLUMNS, 3.0 * rows), squeeze=False)
    for axis in axes.flat[len(groups) :]:
        axis.remove()
    for axis, (name, curves) in zip(axes.flat, groups.items(), strict=False):
        for seed, curve in enumerate(curves):
            axis.plot(np.linspace(0, 1, len(curve)), curve, marker="o", ms=3, label=f"seed {seed}")
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("share of the training")
        axis.set_ylabel("J on validation motions")
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def validation(study: Path, out: Path) -> None:
    """Writes J on the validation motions, in the servo model, of every condition that is there; prints the table."""
    conditions = ("base", "lead", "kalman", "predictor", "stack", "residual")
    cells: dict[str, dict[str, dict[str, float]]] = {}
    for folder in sorted(path.parent for path in study.glob("*/rivals.json")):
        rivals = read_json(folder / "rivals.json")
        found = {name: dict(rivals[name]["validation"]) for name in ("base", "lead", "kalman")}
        stacked = {path.stem[-1] for path in folder.glob("stack-[0-9].json")}
        for kind in conditions[3:]:
            paths = sorted(folder.glob(f"{kind}-[0-9].json"))
            if kind == "predictor":  # of the same seeds as the policies on them
                paths = [path for path in paths if path.stem[-1] in stacked] or paths
            curves = [read_json(path)["figures"]["validation_curve"] for path in paths]
            best = [min(curve, key=lambda point: float(point["J"])) for curve in curves]
            if best:
                found[kind] = {name: float(np.mean([point[name] for point in best])) for name in ("J", "jitter")}
                found[kind]["seeds"] = len(best)
        cells[folder.name] = found
    write_json(out / "results" / "agents-validation.json", cells)
    print(_row("cell", *conditions))
    print("|---" * (len(conditions) + 1) + "|")
    for name, found in cells.items():
        print(_row(name, *(f"{found[kind]['J']:.2f}" if kind in found else "" for kind in conditions)))


def main() -> None:
    """Writes the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--out", type=Path, default=Path("docs"))
    parser.add_argument("--validation", action="store_true", help="only the validation motions")
    given = parser.parse_args()
    if given.validation:
        validation(given.study, given.out)
        return
    cells = {
        (name, level): Cell(given.study, name, level)
        for name, level in CELLS
        if (given.study / name / f"test-{level}.json").is_file()
    }
    source = ["<!-- numbers: docs/results/agents.json -->", ""]
    text = [*source, *bars(cells)]
    for cell in cells.values():
        lines = table(cell)
        first = next(index for index, line in enumerate(lines) if line.startswith("|"))
        text += [*lines[:first], *source, *lines[first:]]
    write_json(
        given.out / "results" / "agents.json",
        {"bars": bars(cells), "cells": {f"{name}:{level}": summary(cell) for (name, level), cell in cells.items()}},
    )
    write_text(
        given.out / "study-agents-tables.md",
        "\n".join(
            [
                "# Study of agents: tables",
                "",
                "<!-- numbers: this page, written by scripts/report_agents.py -->",
                "",
                *text,
            ]
        ),
    )
    with matplotlib.rc_context(plot_theme("dusk")):
        curve_picture(cells, given.out / "images" / "agents-error-jitter.png")
        learning_picture(given.study, given.out / "images" / "agents-learning.png")


if __name__ == "__main__":
    main()
