"""The command ``fit``: recordings become a mapping, with what each further action gained."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.options import (
    JsonOption,
    MethodOption,
    OperatorOption,
    PresetOption,
    RobotOption,
    SeedOption,
    mapping_of,
)
from syda_gym.cli.shared import console, interruptible, print_json, say_written, show_table, stages

if TYPE_CHECKING:
    from syda_gym.routes.piloting.own import OwnFit

__all__ = ["fit"]


def fit(
    data: Annotated[
        list[str] | None, typer.Argument(help="Data sets; by default all that `record` kept.", metavar="[SPEC]...")
    ] = None,
    operator: OperatorOption = None,
    robot: RobotOption = None,
    add: Annotated[bool, typer.Option("--add", help="Add the data sets to those of the stored mapping.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="File to save (.safetensors); by default where `teleop` finds it.",
            callback=checks.ending(".safetensors"),
        ),
    ] = None,
    method: MethodOption = None,
    preset: PresetOption = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Fit a mapping to recordings, judge it on actions held out, and save it.

    Name operator and robot if the data hold several pairs.
    """
    from syda_gym.errors import OptionError
    from syda_gym.routes.piloting.own import fit_own

    if (operator is None) != (robot is None):
        raise OptionError("give both --operator and --robot, or neither")
    name, chosen = mapping_of(method, preset, None)
    words = {"judge": "Fitting, and judging on held-out actions"}
    with interruptible("nothing was saved; run the command again"), stages(words) as tell:
        done = fit_own(
            data or (),
            ends=None if operator is None or robot is None else (operator, robot),
            add=add,
            out=out,
            method=name,
            preset=chosen,
            seed=seed,
            progress=lambda fraction: tell("judge", fraction),
        )
    if as_json:
        print_json({"path": str(done.path), "sources": list(done.sources), **done.judged.as_dict()})
        return
    _print(done)


def _print(done: OwnFit) -> None:
    judged, say = done.judged, console()
    card = judged.mapping.card
    rows = (
        (
            "0 (unfitted)" if row.actions == 0 else str(row.actions),
            f"{row.error:.4f}",
            f"{row.worst:.4f}",
            f"{1000 * row.gained:+.1f}" if row.actions else "",
        )
        for row in judged.rows
    )
    say.print(f"{' > '.join(judged.mapping.route)}: {card.rows} frames of {len(card.actions)} actions", markup=False)
    show_table(("recorded actions", "error on unseen ones [m]", "worst action [m]", "gained [mm]"), rows)
    bound = "none, it takes two actions" if judged.bound is None else f"{judged.bound:.3f} m"
    say.print(f"error bound on unseen actions: {bound}; {judged.advice}", markup=False)
    for notice in done.notices:
        say.print(f"- {notice}", markup=False)
    say_written("saved", done.path)
