"""The paper's Tables 2 to 5 beside ours, an overview per protocol, as tables, CSV files and plots."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.evaluation.paper.cells import CONTENDERS, Cell
from syda_gym.evaluation.paper.results import Study, paper_transferability
from syda_gym.evaluation.report.model import Column, Table
from syda_gym.files import atomic_path, write_json, write_text

__all__ = ["PRINTED", "overview", "tables", "write_study"]

PRINTED: dict[str, Any] = {
    "table2": {
        # pair: 1-S, 1-D, alpha, T, E (m)
        "H2-R1": (0.8878, 0.3561, 1.0, 0.2358, 0.0691),
        "H1-R1": (0.8884, 0.3564, 0.76, 0.2335, 0.0718),
        "R1-H1": (0.6738, 0.0606, 0.76, 0.2002, 0.1368),
        "R1-H2": (0.6781, 0.0589, 1.0, 0.1991, 0.1595),
    },
    # R elbow, R wrist, L elbow, L wrist, average: mean and standard deviation [m]
    "table3": {
        "syda": ((0.0609, 0.0258), (0.0948, 0.0501), (0.0482, 0.0261), (0.0840, 0.0536), (0.0720, 0.0389)),
        "direct": ((0.0695, 0.0641), (0.1124, 0.0711), (0.0497, 0.0369), (0.0832, 0.0716), (0.0787, 0.0609)),
    },
    "table4": {
        "syda": ((0.1040, 0.0487), (0.1394, 0.0603), (0.0704, 0.0624), (0.1410, 0.0837), (0.1137, 0.0638)),
        "direct": ((0.1059, 0.0559), (0.1817, 0.0979), (0.0977, 0.0762), (0.1189, 0.0893), (0.1260, 0.0798)),
    },
    "table5": {"H2-H1-R1": (0.1186, 0.0720, 0.0787), "H1-H2-R1": (0.1071, 0.1137, 0.1260)},
}
"""What the paper prints."""

PROTOCOL_NOTES = {
    "rand3": "rand3, the paper's protocol: random rows. Every file holds its own mirror image and neighbouring rows "
    "are near-duplicates, so test rows were all but seen: this measures interpolation.",
    "twin3": "twin3: random rows, mirror twins kept together; poses still come from trained actions.",
    "loao": "LOAO: the test action, its mirror image and its repeats were never seen. The honest protocol.",
}

_CHAINS = {"H2-H1-R1": "kid", "H1-H2-R1": "adult"}
"""Chain to the human whose cell holds its link into the robot."""

# Landmarks are ordered left elbow, left wrist, right elbow, right wrist; the paper prints the right arm first.
_PRINT_ORDER = (2, 3, 0, 1)
_JOINTS = ("R elbow", "R wrist", "L elbow", "L wrist")


def tables(study: Study) -> list[Table]:
    """Tables 2 to 5, the overview of every protocol, few recordings and causal windows."""
    t = paper_transferability()
    found = [_table2(study, t), _chain_table(study, "table3"), _chain_table(study, "table4"), _table5(study, t)]
    protocols = [name for name in PROTOCOL_NOTES if any(key[1] == name for key in study.cells)]
    found += [overview(study, name) for name in protocols]
    return [*found, *([_few_shot(study)] if study.few_shot else []), *([_windows(study)] if study.windows else [])]


def overview(study: Study, protocol: str) -> Table:
    """Every method under one protocol: six errors, and what else a fair comparison needs."""
    rows = []
    for contender in CONTENDERS:
        adult, kid = (study.cell(contender.name, protocol, human) for human in ("adult", "kid"))
        if adult is None or kid is None:
            continue
        worst = max([*adult.actions.values(), *kid.actions.values()])
        rows.append(
            [
                contender.name,
                *(_with_spread(v) for v in (adult.error, kid.error, kid.error_back, adult.error_back)),
                *(_with_spread(v) for v in (kid.chain, adult.chain)),
                f"{worst:.4f}",
                f"{_mean(adult.aligned):.4f} / {_mean(kid.aligned):.4f}" if adult.aligned and kid.aligned else "",
                f"{100 * max(adult.limit_violations, kid.limit_violations):.1f}",
                _percent(adult.speed_violations, kid.speed_violations),
                _bounds(adult, kid),
            ]
        )
    names = ("H2>R1", "H1>R1", "R1>H1", "R1>H2", "H2-H1-R1", "H1-H2-R1")
    return Table(
        f"Errors E (m), {protocol}, mean ± s.d. over seeds",
        [
            Column("method"),
            *(Column(name) for name in names),
            Column("worst action", tip="largest mean error of one action, human to robot"),
            Column("aligned", tip="after the best shift of every test recording: an oracle, adult / kid"),
            Column("limits %", tip="joint angles beyond the limits before they are enforced"),
            Column("speed %", tip="joint steps beyond the speed limits before they are enforced"),
            Column("bound", tip="error bound [m], coverage overall, coverage of the worst action"),
        ],
        rows,
        note=PROTOCOL_NOTES[protocol],
    )


def _few_shot(study: Study) -> Table:
    rows = [
        [
            {"adult": "H2-H1-R1", "kid": "H1-H2-R1"}[newcomer],
            str(row["count"]),
            f"{row['chain']:.4f} ± {row['chain_spread']:.4f}",
            f"{row['direct']:.4f} ± {row['direct_spread']:.4f}",
            f"{row['geometric']:.4f} ± {row['geometric_spread']:.4f}",
        ]
        for newcomer, found in sorted(study.few_shot.items())
        for row in found
    ]
    return Table(
        "Few recordings: k paired actions of a new body, E (m), LOAO",
        [
            Column("chain"),
            Column("k"),
            Column("chain E"),
            Column("direct pair E"),
            Column("geometry alone E"),
        ],
        rows,
        note="syda/general, mean ± s.d. over draws of the k actions. Chain: k actions of the new body with the known "
        "one, whose link into the robot lacks the scored action. Direct pair: k other actions with the robot; geometry "
        "alone learns a rotation from them.",
    )


def _windows(study: Study) -> Table:
    rows = [
        [
            human,
            row["name"],
            f"{row['error']:.4f}",
            f"{row['inside']:.4f}",
            f"{100 * row['gain']:.1f}",
            f"{100 * row['gain_inside']:.1f}",
        ]
        for human, found in sorted(study.windows.items())
        for row in found
    ]
    return Table(
        "Causal windows with their controls, E (m), LOAO, ridge",
        [Column(name) for name in ("human", "variant", "E", "E, frames >= 8", "gain %", "gain %, frames >= 8")],
        rows,
        note="Clips are short and start alike, so a window tells how far a clip has come. A gain is believable only "
        "where it exceeds that of the bare frame index and holds on frames well inside a clip.",
    )


def _table2(study: Study, t: dict[str, dict[str, float]]) -> Table:
    rows = []
    for name, (lack, capability, alpha, value, error) in PRINTED["table2"].items():
        human = {"H1": "kid", "H2": "adult"}[name.replace("R1", "").strip("-")]
        back = name.startswith("R1")
        cells = [
            study.cell(contender, protocol, human)
            for contender, protocol in (("syda/paper", "rand3"), ("syda/paper", "loao"), ("syda/general", "loao"))
        ]
        errors = [_with_spread((c.error_back if back else c.error) if c else []) for c in cells]
        ours = t[name]
        rows.append(
            [
                name,
                f"{1 - ours['S']:.4f} ({lack:.4f})",
                f"{1 - ours['D']:.4f} ({capability:.4f})",
                f"{ours['alpha']:.2f} ({alpha:.2f})",
                f"{ours['T']:.4f} ({value:.4f})",
                f"{error:.4f}",
                *errors,
            ]
        )
    titles = ("pair", "1-S", "1-D", "alpha", "T", "E printed", "E rand3", "E LOAO", "E general LOAO")
    return Table(
        "Table 2: transferability and error of the pairs, ours (printed)",
        [Column(title) for title in titles],
        rows,
        note="E (m). rand3 is the paper's protocol, with SyDa as published. The two right columns are leave-one-action-"
        "out, with SyDa as published and with the general preset.",
    )


def _chain_table(study: Study, name: str) -> Table:
    chain = {"table3": "H2-H1-R1", "table4": "H1-H2-R1"}[name]
    rows: list[list[str]] = []
    for method, values in PRINTED[name].items():
        rows.append([f"{method}, printed", "paper", *(f"{mean:.4f} ± {spread:.4f}" for mean, spread in values), ""])
    for protocol in ("rand3", "loao"):
        for contender in CONTENDERS:
            cell = study.cell(contender.name, protocol, _CHAINS[chain])
            if cell is None or not cell.chain:
                continue
            means = np.array(cell.chain_joints).mean(axis=0)[list(_PRINT_ORDER)]
            spreads = np.array(cell.chain_spread).mean(axis=0)[list(_PRINT_ORDER)]
            joints = [f"{mean:.4f} ± {spread:.4f}" for mean, spread in zip(means, spreads, strict=True)]
            average = f"{means.mean():.4f} ± {spreads.mean():.4f}"
            label = "all rows" if protocol == "rand3" else "LOAO"
            rows.append([contender.name, label, *joints, average, f"{np.std(cell.chain):.4f}"])
    return Table(
        f"{name.title()[:5]} {name[-1]}: chain {chain}",
        [Column("method"), Column("link"), *(Column(joint) for joint in _JOINTS), Column("average"), Column("seeds")],
        rows,
        note="E (m), mean ± s.d. over frames as the paper prints it; last column: s.d. of the mean over seeds. "
        "The end pair is never fitted. 'all rows': the link into Pepper is fitted to all its rows, as in the paper; "
        "'LOAO': without the action that is scored.",
    )


def _table5(study: Study, t: dict[str, dict[str, float]]) -> Table:
    rows = []
    for chain, (value, syda, direct) in PRINTED["table5"].items():
        a, b, c = chain.split("-")
        ours = t[f"{a}-{b}"]["T"] * t[f"{b}-{c}"]["T"]
        errors = []
        for contender, protocol in (
            ("syda/paper", "rand3"),
            ("direct/paper", "rand3"),
            ("syda/paper", "loao"),
            ("direct/paper", "loao"),
            ("syda/general", "loao"),
        ):
            cell = study.cell(contender, protocol, _CHAINS[chain])
            errors.append(_with_spread(cell.chain if cell else []))
        rows.append([chain, f"{ours:.4f} ({value:.4f})", f"{syda:.4f}", f"{direct:.4f}", *errors])
    return Table(
        "Table 5: transferability and error of the chains, ours (printed)",
        [
            Column(title)
            for title in (
                "chain", "T", "SyDa printed", "direct printed", "SyDa", "direct", "SyDa LOAO", "direct LOAO",
                "general LOAO",
            )
        ],
        rows,
        note="E (m), mean ± s.d. over seeds.",
    )  # fmt: skip


def write_study(study: Study, out: str | os.PathLike[str], about: dict[str, str]) -> Path:
    """Writes every table as CSV (``table2.csv``, ``overview_loao.csv``, ``few_shot.csv``, ...), ``study.json``, plots.

    Args:
        study: what to write.
        out: folder.
        about: versions.

    Returns:
        The folder.
    """
    folder = Path(out)
    for table in tables(study):
        write_text(folder / f"{_stem(table.title)}.csv", _csv([c.title for c in table.columns], table.rows))
    cells = [asdict(study.cells[key]) for key in sorted(study.cells)]  # whoever finished first
    write_json(
        folder / "study.json",
        {
            "data": study.data,
            "seeds": study.seeds,
            "skipped": study.skipped,
            "failed": study.failed,
            "versions": about,
            "cells": cells,
            "few_shot": study.few_shot,
            "windows": study.windows,
        },
    )
    for protocol in PROTOCOL_NOTES:
        if any(key[1] == protocol for key in study.cells):
            _plot(study, protocol, folder / f"errors_{protocol}.png")
    return folder


_FILES = {"errors": "overview_{}", "few": "few_shot", "causal": "windows"}


def _stem(title: str) -> str:
    """File name of a table."""
    words = title.lower()
    if words.startswith("table"):
        return words.split(":")[0].replace(" ", "")
    return _FILES[words.split(" ")[0]].format(words.split(", ")[1])


def _plot(study: Study, protocol: str, path: Path) -> None:
    """Bars with the spread over seeds: six directions, one colour a method."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [
        c.name for c in CONTENDERS if study.cell(c.name, protocol, "adult") and study.cell(c.name, protocol, "kid")
    ]
    groups = ["H2>R1", "H1>R1", "R1>H1", "R1>H2"] + (["H2-H1-R1", "H1-H2-R1"] if protocol != "twin3" else [])
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    width = 0.84 / max(len(names), 1)
    for index, name in enumerate(names):
        adult, kid = study.cells[name, protocol, "adult"], study.cells[name, protocol, "kid"]
        values = [adult.error, kid.error, kid.error_back, adult.error_back, kid.chain, adult.chain][: len(groups)]
        places = np.arange(len(groups)) - 0.42 + (index + 0.5) * width
        heights = [100 * _mean(v) if v else 0.0 for v in values]
        spreads = [100 * float(np.std(v)) if v else 0.0 for v in values]
        colour = f"C{index}" if index < 10 else ("black", "gold", "navy")[index % 3]
        axes.bar(places, heights, width, yerr=spreads, label=name, color=colour, error_kw={"lw": 0.8})
    axes.set_xticks(range(len(groups)), groups)
    axes.set_ylabel("error E [cm]")
    axes.set_title(f"{study.data}, {protocol}, {study.seeds} seeds", fontsize=10)
    axes.grid(axis="y", alpha=0.3)
    figure.legend(fontsize=7, ncol=6, loc="outside lower center")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130)


def _csv(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()


def _with_spread(values: Sequence[float]) -> str:
    if not values:
        return ""
    return f"{_mean(values):.4f}" if len(values) == 1 else f"{_mean(values):.4f} ± {float(np.std(values)):.4f}"


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values))


def _percent(*shares: float | None) -> str:
    known = [share for share in shares if share is not None]
    return f"{100 * max(known):.1f}" if known else ""


def _bounds(adult: Cell, kid: Cell) -> str:
    if None in (adult.bound, kid.bound, adult.covered, kid.covered, adult.covered_worst, kid.covered_worst):
        return ""
    return " / ".join(f"{c.bound:.3f}: {c.covered:.2f}, worst {c.covered_worst:.2f}" for c in (adult, kid))
