"""The command ``journal``: what a live run left behind; registered by ``cli``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.shared import console, say_written
from syda_gym.cli.spellings import Program

__all__ = ["journal_app"]

journal_app = Program(help="Journals of live runs, for other programs to look at.", no_args_is_help=True)


@journal_app.callback()
def _journal() -> None:
    """Journals of live runs, for other programs to look at."""


@journal_app.command("export")
def _journal_export(
    journal: Annotated[Path, typer.Argument(help="A `.jsonl` or `.jsonl.gz` that `teleop --journal` wrote.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The `.mcap` to write.", callback=checks.ending(".mcap"))
    ] = Path("run.mcap"),
) -> None:
    """Write a journal as MCAP, which Foxglove, Rerun and ROS open (extra `ros`)."""
    from syda_gym.teleoperation.bags.export import export_journal

    written = export_journal(journal, out)
    if written.damage:
        console().print(f"[red]the journal is not whole[/]: {written.damage}")
    say_written(f"{written.decisions} decisions", written.path)
