"""The command line: thin; every command calls one public function and prints what it found."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.errors import SydaError

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["app", "console", "main", "print_table", "stages"]

app = typer.Typer(
    name="syda-gym",
    help="Map a human's motion onto a humanoid, chain such maps, know which chain will work, and prove how good it is.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)

MotionsOption = Annotated[
    str,
    typer.Option("--motions", "-m", help="`embedded`, `paper:DIR`, `npz:FILE` or another recording.", metavar="SPEC"),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder to write to; created if need be.")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0)]


def main() -> None:
    """Runs the command line; an error of the library is one clear line and exit code 2."""
    try:
        app(prog_name="syda-gym")
    except SydaError as error:
        console(stderr=True).print(f"error: {error}", style="bold red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt:
        console(stderr=True).print("interrupted", style="bold red")
        sys.exit(130)


def console(*, stderr: bool = False) -> Console:
    """A rich console."""
    from rich.console import Console

    return Console(stderr=stderr)


def print_table(table: Any) -> None:
    """Prints a ``syda_gym.evaluation.report.Table`` on the terminal."""
    from syda_gym.evaluation.terminal import rich_table

    console().print(rich_table(table))


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


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.", is_eager=True)] = False,
) -> None:
    if version:
        from syda_gym import __version__

        typer.echo(f"syda-gym {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        raise typer.Exit(code=2)


@app.command()
def demo(
    motions: MotionsOption = "embedded",
    out: OutOption = Path("demo"),
    robot: Annotated[str, typer.Option(help="Who is driven; by default Pepper or the first robot.")] = "",
    seed: SeedOption = 0,
    residual: Annotated[bool, typer.Option(help="Train the short residual policy.")] = True,
) -> None:
    """Run everything once: fit the pairs, rank and play every chain, train a residual, write a report."""
    from syda_gym.evaluation.demo import run_demo
    from syda_gym.evaluation.demo_report import chain_table, transferability_table

    words = {
        "load": "Loading motions",
        "transferability": "Measuring transferability",
        "fit": "Fitting mappings",
        "play": "Playing chains as episodes",
        "residual": "Training the residual policy",
        "report": "Drawing the report",
    }
    with stages(words) as tell:
        result = run_demo(
            motions, out, robot=robot or None, seed=seed, residual=residual, command=_command(), progress=tell
        )
    print_table(transferability_table(result))
    for operator, route in result.chosen.items():
        console().print(f"Route chosen for [bold]{operator}[/]: [bold]{' > '.join(route)}[/]")
    print_table(chain_table(result))
    if result.residual:
        print_table(result.residual.table())
    console().print(f"\nReport: [bold]{result.report}[/]  (open it in a browser)")


def _command() -> str:
    """The command line as the user wrote it."""
    import shlex

    return shlex.join(["syda-gym", *sys.argv[1:]])
