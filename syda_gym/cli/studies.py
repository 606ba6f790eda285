"""The commands that run from recordings to a report: ``demo`` and ``reproduce-paper``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.names import METHODS, PROTOCOLS, ticked
from syda_gym.cli.options import MethodsOption, MotionsOption, OutFolderOption, SeedOption
from syda_gym.cli.shared import console, interruptible, print_table, say_written, stages, typed_command

__all__ = ["demo", "reproduce_paper"]


def demo(
    motions: MotionsOption = "embedded",
    out: OutFolderOption = Path("demo"),
    robot: Annotated[
        str | None, typer.Option("--robot", help="Who follows: a robot of the motions; by default Pepper or the first.")
    ] = None,
    seed: SeedOption = 0,
    residual: Annotated[bool, typer.Option(help="Train the short residual policy.")] = True,
) -> None:
    """Run everything once: whom to pair a new operator with, asked before any fit and checked after."""
    from syda_gym.evaluation.demo.report import chain_table
    from syda_gym.evaluation.demo.run import run_demo
    from syda_gym.evaluation.demo.story import dry_run_table, next_steps, shows

    words = {
        "load": "Loading motions",
        "transferability": "Asking the dry run",
        "fit": "Fitting mappings",
        "play": "Playing chains as episodes",
        "residual": "Training the residual policy",
        "report": "Drawing the report",
    }
    with (
        interruptible(f"nothing half-written is in {out}; run the demo again, it takes a few minutes"),
        stages(words) as tell,
    ):
        result = run_demo(
            motions, out, robot=robot, seed=seed, residual=residual, command=typed_command(), progress=tell
        )
    print_table(dry_run_table(result))
    print_table(chain_table(result))
    if result.residual:
        print_table(result.residual.table())
    for title, lines in (("What this shows", shows(result)), ("What to do next with your robot", next_steps(result))):
        console().print(f"\n[bold]{title}[/]")
        for line in lines:
            console().print(f"- {line}", highlight=False)
    say_written("\nReport", result.report or out, "(open it in a browser)")


def reproduce_paper(
    motions: MotionsOption,
    out: OutFolderOption = Path("reproduce-paper"),
    seeds: Annotated[int, typer.Option("--seeds", help="How many seeds of splits and networks.", min=1)] = 10,
    protocol: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Only {ticked(PROTOCOLS)}; repeatable or comma-separated.",
            callback=checks.several(PROTOCOLS, "protocol"),
        ),
    ] = None,
    method: MethodsOption = None,
    workers: Annotated[int, typer.Option("--workers", "-w", help="Processes on this machine.", min=1)] = 2,
) -> None:
    """Print the paper's Tables 2 to 5 beside ours: every method, three labelled protocols, many seeds."""
    from syda_gym.evaluation.paper.report import tables
    from syda_gym.evaluation.paper.study import reproduce
    from syda_gym.motions.clip import PROTOCOLS

    kept = f"finished parts are kept in {out}; the same command goes on from there"
    with interruptible(kept), _parts() as (progress, inside):
        study = reproduce(
            motions,
            out,
            seeds=seeds,
            protocols=tuple(protocol) if protocol else PROTOCOLS,
            contenders=[_contender(text) for text in method] if method else None,
            workers=workers,
            progress=progress,
            inside=inside,
        )
    for table in tables(study):
        print_table(table)
    for name, reason in study.skipped.items():
        console(stderr=True).print(f"left out {name}: {reason}", markup=False)
    for name, trace in study.failed.items():
        last = trace.strip().splitlines()[-1]
        console(stderr=True).print(f"failed: {name}: {last}", style="red", markup=False, soft_wrap=True)
    say_written("tables, plots and study.json", out)
    if study.failed:
        raise typer.Exit(code=1)


def _contender(text: str) -> str:
    """``NAME[:PRESET]`` as the study calls it: ``NAME/PRESET``, with the default preset where none is named."""
    name, _, preset = text.partition(":")
    return f"{name}/{preset or METHODS[name][0]}"


@contextmanager
def _parts() -> Iterator[tuple[Callable[[float, str], None], Callable[[float, str], None]]]:
    """A progress bar that moves within parts, too, and names the part that is being computed."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        BarColumn(),
        TextColumn("{task.percentage:>5.1f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console(stderr=True)) as bar:
        task = bar.add_task("reading", total=1.0)

        def finished(fraction: float, name: str) -> None:
            bar.update(task, completed=fraction, description=name)
            if not bar.console.is_terminal:
                bar.console.print(f"{100 * fraction:5.1f} %  {name}", markup=False, highlight=False)

        yield finished, lambda fraction, name: bar.update(task, completed=fraction, description=name)
