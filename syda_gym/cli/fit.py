"""The command ``fit``: recordings become a mapping, with what each further action gained."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syda_gym.cli.shared import JsonOption, SeedOption, console, print_json, stages

if TYPE_CHECKING:
    from syda_gym.routes.own import OwnFit

__all__ = ["fit"]


def fit(
    data: Annotated[
        list[str] | None, typer.Argument(help="Data sets; by default all that `record` kept.", metavar="[SPEC]...")
    ] = None,
    source: Annotated[
        str | None, typer.Option("--from", help="Who leads; needed if the data hold several pairs.")
    ] = None,
    target: Annotated[str | None, typer.Option("--to", help="Who follows.")] = None,
    add: Annotated[bool, typer.Option("--add", help="Add the data sets to those of the stored mapping.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Where to save; by default where `teleop` finds it.")
    ] = None,
    method: Annotated[str, typer.Option(help="Mapping method, with a preset behind a colon.")] = "syda",
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Fit a mapping to recordings, judge it on actions held out, and save it."""
    from syda_gym.errors import OptionError
    from syda_gym.routes.own import fit_own

    if (source is None) != (target is None):
        raise OptionError("give both --from and --to, or neither")
    name, _, preset = method.partition(":")
    with stages({"judge": "Fitting, and judging on held-out actions"}) as tell:
        done = fit_own(
            data or (),
            ends=None if source is None or target is None else (source, target),
            add=add,
            out=out,
            method=name,
            preset=preset or None,
            seed=seed,
            progress=lambda fraction: tell("judge", fraction),
        )
    if as_json:
        print_json({"path": str(done.path), "sources": list(done.sources), **done.judged.as_dict()})
        return
    _print(done)


def _print(done: OwnFit) -> None:
    from rich.table import Table

    judged, say = done.judged, console()
    card = judged.mapping.card
    table = Table("recorded actions", "error on unseen ones \\[m]", "worst action \\[m]", "gained \\[mm]")
    for row in judged.rows:
        name = "0 (unfitted)" if row.actions == 0 else str(row.actions)
        gained = f"{1000 * row.gained:+.1f}" if row.actions else ""
        table.add_row(name, f"{row.error:.4f}", f"{row.worst:.4f}", gained)
    say.print(f"{' > '.join(judged.mapping.route)}: {card.rows} frames of {len(card.actions)} actions", markup=False)
    say.print(table)
    bound = "none, it takes two actions" if judged.bound is None else f"{judged.bound:.3f} m"
    say.print(f"error bound on unseen actions: {bound}; {judged.advice}", markup=False)
    for notice in done.notices:
        say.print(f"- {notice}", markup=False)
    say.print(f"saved: [bold]{done.path}[/]", soft_wrap=True)
