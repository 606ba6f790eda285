"""The commands that run from recordings to a report: ``demo`` and ``reproduce-paper``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli.shared import (
    MotionsOption,
    OutOption,
    SeedOption,
    console,
    interruptible,
    print_table,
    stages,
    typed_command,
)

__all__ = ["demo", "reproduce_paper"]


def demo(
    motions: MotionsOption = "embedded",
    out: OutOption = Path("demo"),
    robot: Annotated[str, typer.Option(help="Who is driven; by default Pepper or the first robot.")] = "",
    seed: SeedOption = 0,
    residual: Annotated[bool, typer.Option(help="Train the short residual policy.")] = True,
) -> None:
    """Run everything once: fit the pairs, rank and play every chain, train a residual, write a report."""
    from syda_gym.evaluation.demo.report import chain_table, transferability_table
    from syda_gym.evaluation.demo.run import run_demo

    words = {
        "load": "Loading motions",
        "transferability": "Measuring transferability",
        "fit": "Fitting mappings",
        "play": "Playing chains as episodes",
        "residual": "Training the residual policy",
        "report": "Drawing the report",
    }
    with (
        interruptible(f"nothing half-written is in {out}; run the demo again, it takes about a minute"),
        stages(words) as tell,
    ):
        result = run_demo(
            motions, out, robot=robot or None, seed=seed, residual=residual, command=typed_command(), progress=tell
        )
    print_table(transferability_table(result))
    for operator, route in result.chosen.items():
        ties = "".join(f"; {' > '.join(other.bodies)} lies within sampling noise" for other in route.ties)
        console().print(f"Route chosen for [bold]{operator}[/]: [bold]{' > '.join(route.bodies)}[/]{ties}")
    print_table(chain_table(result))
    if result.residual:
        print_table(result.residual.table())
    console().print(f"\nReport: [bold]{result.report}[/]  (open it in a browser)")


def reproduce_paper(
    motions: Annotated[
        str, typer.Option("--motions", "-m", help="`paper:DIR`: the paper's recordings.", metavar="SPEC")
    ],
    out: OutOption = Path("reproduce-paper"),
    seeds: Annotated[int, typer.Option(help="Seeds of splits and networks.", min=1)] = 10,
    protocol: Annotated[list[str] | None, typer.Option(help="Only `rand3`, `twin3` or `loao`; repeatable.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only this `method/preset`; repeatable.")] = None,
    workers: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
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
            contenders=method,
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
    console(stderr=True).print(f"tables, plots and study.json are in {out}", markup=False)
    if study.failed:
        raise typer.Exit(code=1)


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
