"""What all commands share: options, the console, tables, progress; knows no command."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

__all__ = [
    "DEFAULT_VIEW",
    "AppearanceOption",
    "JsonOption",
    "MotionsOption",
    "OutOption",
    "SeedOption",
    "ViewAddressOption",
    "ViewOption",
    "console",
    "print_json",
    "print_table",
    "stages",
    "typed_command",
]

MotionsOption = Annotated[
    str,
    typer.Option("--motions", "-m", help="`embedded`, `paper:DIR`, `npz:FILE` or another recording.", metavar="SPEC"),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder to write to; created if need be.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
DEFAULT_VIEW = "127.0.0.1:8099"
ViewOption = Annotated[bool, typer.Option("--view", help="Show it live on a page in the browser (extra `view`).")]
ViewAddressOption = Annotated[
    str, typer.Option("--view-address", help="Where the page listens; port 0 takes any that is free.")
]
AppearanceOption = Annotated[
    Path | None, typer.Option(help="Another URDF of the robot to show on the page, say the vendor's with meshes.")
]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0)]


def console(*, stderr: bool = False) -> Console:
    """A rich console."""
    from rich.console import Console

    return Console(stderr=stderr)


def print_json(value: Any) -> None:
    """Prints JSON and nothing else, for other programs."""
    import json

    typer.echo(json.dumps(value, indent=1))


def print_table(table: Any) -> None:
    """Prints a ``syda_gym.evaluation.report.Table`` on the terminal."""
    from syda_gym.evaluation import terminal

    terminal.print_table(table, console())


@contextmanager
def stages(names: dict[str, str]) -> Iterator[Callable[[str, float], None]]:
    """Shows one progress bar a stage.

    Args:
        names: stage to the words that are shown.

    Yields:
        A function that is told the stage and its finished fraction.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<38}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*columns, TimeElapsedColumn(), console=console(stderr=True)) as progress:
        bars: dict[str, Any] = {}

        def tell(stage: str, done: float) -> None:
            if stage not in bars:
                bars[stage] = progress.add_task(names.get(stage, stage), total=1.0)
            progress.update(bars[stage], completed=min(1.0, done))

        yield tell


def typed_command() -> str:
    """The command line as the user wrote it."""
    import shlex

    return shlex.join(["syda-gym", *sys.argv[1:]])
