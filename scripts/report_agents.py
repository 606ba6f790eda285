"""Turns a finished study (scripts/study_agents.py) into docs/study-agents.md and its pictures.

    python scripts/report_agents.py --study study --out docs

Means over the seeds of a condition come first, per test motion; then interquartile means over motions with bootstrap
intervals that redraw motions within their action. Nothing here looks at anything but the stored figures.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.evaluation.statistics import estimate, iqm, probability_of_improvement
from syda_gym.files import read_json, write_json, write_text

CELLS = (
    ("lag", "test"),
    ("noise", "test"),
    ("latency", "test"),
    ("noise-latency", "test"),
    ("full", "test"),
    ("full", "harsh"),
)
RIVALS = ("base", "lead", "one_euro", "one_euro_lead", "ema_lead", "kalman")
Rows = Mapping[str, Sequence[Mapping[str, Any]]]


class Cell:
    """Figures of one cell: per condition a matrix of motions, averaged over seeds."""

    def __init__(self, study: Path, name: str, level: str) -> None:
        self.name, self.level = name, level
        rows: Rows = read_json(study / name / f"test-{level}.json")
        tuned = read_json(study / name / "rivals.json")
        self.best_rival = min(RIVALS, key=lambda rival: float(tuned[rival]["validation"]["J"]))
        grouped: dict[str, list[Sequence[Mapping[str, Any]]]] = defaultdict(list)
        for label, found in rows.items():
            grouped[label.rsplit("-", 1)[0] if label[-1].isdigit() else label].append(found)
        self.runs = grouped
        self.seeds = {condition: len(found) for condition, found in grouped.items()}
        first = next(iter(rows.values()))
        self.actions = [str(row["action"]) for row in first]
        self.feasible = np.array([bool(row["feasible"]) for row in first])

    def values(self, condition: str, figure: str) -> NDArray[np.float64]:
        """One value per test motion, the mean over seeds."""
        return np.mean([[float(row[figure]) for row in run] for run in self.runs[condition]], axis=0)

    def conditions(self) -> list[str]:
        """Rivals first, then what was learned."""
        return [*RIVALS, *sorted(name for name in self.runs if name not in RIVALS)]


def table(cell: Cell) -> list[str]:
    """Markdown table of one cell."""
    lines = [
        f"### {cell.name}, level {cell.level}",
        "",
        f"{len(cell.actions)} motions of {len(set(cell.actions))} actions; best rival on validation: "
        f"`{cell.best_rival}`.",
        "",
        "| agent | seeds | landmark error [mm] | jitter [mm/frame³] | J | 95 % of J | beats the rival |",
        "|---|---|---|---|---|---|---|",
    ]
    rival = cell.values(cell.best_rival, "J")
    for name in cell.conditions():
        interval = estimate(cell.values(name, "J"), cell.actions)
        better = probability_of_improvement(cell.values(name, "J"), rival, cell.actions, cell.actions)
        lines.append(
            f"| {name} | {cell.seeds[name]} | {iqm(cell.values(name, 'landmark_mm')):.2f} | "
            f"{iqm(cell.values(name, 'jitter')):.2f} | {interval.value:.2f} | "
            f"{interval.low:.2f} to {interval.high:.2f} | {better.value:.2f} |"
        )
    return [*lines, ""]


def numbers(cells: Mapping[tuple[str, str], Cell]) -> dict[str, Any]:
    """The tables as plain data."""
    result: dict[str, Any] = {}
    for (name, level), cell in cells.items():
        rival = cell.values(cell.best_rival, "J")
        for condition in cell.conditions():
            values = cell.values(condition, "J")
            interval = estimate(values, cell.actions)
            entry = {figure: iqm(cell.values(condition, figure)) for figure in ("landmark_mm", "joint_mrad", "jitter")}
            entry |= {"J": interval.value, "J_low": interval.low, "J_high": interval.high}
            entry["beats_rival"] = probability_of_improvement(values, rival, cell.actions, cell.actions).value
            entry["seeds"] = cell.seeds[condition]
            result.setdefault(f"{name}:{level}", {})[condition] = entry
    return result


def ratio(cell: Cell, condition: str, baseline: str, figure: str, which: NDArray[np.bool_] | None = None) -> float:
    """Mean of a condition over that of a baseline, on all motions or on some of them."""
    chosen = np.ones(len(cell.actions), dtype=bool) if which is None else which
    return float(cell.values(condition, figure)[chosen].mean() / cell.values(baseline, figure)[chosen].mean())


def bars(cells: Mapping[tuple[str, str], Cell]) -> list[str]:
    """The bars of the study, each with what was measured and whether it holds."""
    rows = ["| bar | asked | measured | held |", "|---|---|---|---|"]

    def row(words: str, asked: str, measured: str, held: bool) -> None:
        rows.append(f"| {words} | {asked} | {measured} | {'yes' if held else '**no**'} |")

    lag = cells["lag", "test"]
    for words, rows_used in (("all motions", None), ("motions within the speed limits", lag.feasible)):
        recovered = 1.0 - ratio(lag, "lead", "base", "landmark_mm", rows_used)
        row(
            f"lag: the lead recovers the base's landmark error, {words}",
            ">= 0.90",
            f"{recovered:.3f}",
            recovered >= 0.90,
        )
    full = cells["full", "test"]
    if "residual" in full.runs:
        j = ratio(full, "residual", "full_rival", "J")
        row("full: residual, J against its rival", "<= 0.98", f"{j:.3f}", j <= 0.98)
        for (name, level), cell in cells.items():
            if (name, level) == ("full", "test"):
                continue
            error = ratio(cell, "residual", "full_rival", "landmark_mm")
            jitter = ratio(cell, "residual", "full_rival", "jitter")
            row(
                f"{name} ({level}): the same residual does no harm",
                "error <= 1.05, jitter <= 1.20",
                f"{error:.3f}, {jitter:.3f}",
                error <= 1.05 and jitter <= 1.20,
            )
    for name, limit in (("noise", 0.95), ("noise-latency", 0.96), ("full", 0.95)):
        cell = cells[name, "test"]
        found = "predictor" if "predictor" in cell.runs else "full_predictor"
        j, error, jitter = (ratio(cell, found, cell.best_rival, f) for f in ("J", "landmark_mm", "jitter"))
        row(f"{name}: `{found}`, J against `{cell.best_rival}`", f"<= {limit}", f"{j:.3f}", j <= limit)
        row(
            f"{name}: `{found}`, error and jitter",
            "<= 1.02 and <= 0.80",
            f"{error:.3f}, {jitter:.3f}",
            error <= 1.02 and jitter <= 0.80,
        )
    late = cells["latency", "test"]
    if "predictor" in late.runs:
        error, jitter = (ratio(late, "predictor", late.best_rival, f) for f in ("landmark_mm", "jitter"))
        row(
            "latency: predictor on the Kalman stream, error at equal or lower jitter",
            "<= 0.85 at <= 1.00",
            f"{error:.3f} at {jitter:.3f}",
            error <= 0.85 and jitter <= 1.0,
        )
    harsh = cells["full", "harsh"]
    if "predictor" in harsh.runs:
        j = ratio(harsh, "predictor", harsh.best_rival, "J")
        row("full, harsh: predictor, J against the rival", "<= 1.00", f"{j:.3f}", j <= 1.0)
    return [*rows, ""]


def curve_picture(cells: Mapping[tuple[str, str], Cell], path: Path) -> None:
    """Error against jitter with every method on it, one panel a cell."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(13, 8))
    for axis, cell in zip(axes.ravel(), cells.values(), strict=True):
        names = cell.conditions()
        for index, name in enumerate(names):
            x, y = iqm(cell.values(name, "jitter")), iqm(cell.values(name, "landmark_mm"))
            learned = "predictor" in name or "residual" in name
            axis.scatter(
                x, y, s=60, marker="*" if learned else "o", color=plt.cm.tab20(index % 20), zorder=3, label=name
            )
        axis.set_title(f"{cell.name} ({cell.level})")
        axis.set_xlabel("jitter [mm/frame³]")
        axis.set_ylabel("landmark error [mm]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def learning_picture(study: Path, path: Path) -> None:
    """Validation objective over training, one line a seed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    groups: dict[str, list[list[float]]] = defaultdict(list)
    for file in sorted(study.glob("*/*-[0-9].json")):
        curve = read_json(file)["figures"]["validation_curve"]
        groups[f"{file.parent.name}: {file.stem[:-2]}"].append([float(point["J"]) for point in curve])
    figure, axes = plt.subplots(1, max(len(groups), 1), figsize=(3.2 * max(len(groups), 1), 3.4), squeeze=False)
    for axis, (name, curves) in zip(axes[0], groups.items(), strict=False):
        for seed, curve in enumerate(curves):
            axis.plot(np.linspace(0, 1, len(curve)), curve, marker="o", ms=3, label=f"seed {seed}")
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("share of the training")
        axis.set_ylabel("J on validation motions")
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Writes the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--out", type=Path, default=Path("docs"))
    given = parser.parse_args()
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
    write_json(given.out / "results" / "agents.json", {"bars": bars(cells), "cells": numbers(cells)})
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
    curve_picture(cells, given.out / "images" / "agents-error-jitter.png")
    learning_picture(given.study, given.out / "images" / "agents-learning.png")


if __name__ == "__main__":
    main()
