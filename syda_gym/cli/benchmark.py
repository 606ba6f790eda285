"""The commands that compare many chains: ``benchmark``, ``compare``, ``suggest`` and ``export-episodes``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.cli.shared import console, interruptible, print_table, typed_command

if TYPE_CHECKING:
    pass

__all__ = ["benchmark", "compare", "export_episodes", "suggest"]

OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder to write to; created if need be.")]
MotionsOption = Annotated[str, typer.Option("--motions", "-m", help="What to replay.", metavar="SPEC")]


def benchmark(
    config: Annotated[Path | None, typer.Argument(help="YAML file; without one a small benchmark is run.")] = None,
    out: OutOption = Path("benchmark"),
    workers: Annotated[
        str, typer.Option("--workers", "-w", help="Processes on this machine, `ray` or `ray:ADDRESS`.", metavar="N")
    ] = "1",
    motions: Annotated[
        str, typer.Option("--motions", "-m", help="What to replay instead of the file's.", metavar="SPEC")
    ] = "",
    parquet: Annotated[bool, typer.Option("--parquet", help="Write Parquet instead of CSV.")] = False,
    show: Annotated[bool, typer.Option("--show", help="Print the configuration with all defaults and stop.")] = False,
) -> None:
    """Play every chain x method x agent x disturbance x seed on held-out actions; goes on where it stopped."""
    from syda_gym.evaluation.benchmark import BenchmarkConfig, run_benchmark
    from syda_gym.evaluation.benchmark.report import summary_table, write_benchmark_report
    from syda_gym.motions.loading import load_motions

    settings = BenchmarkConfig.read(config) if config else BenchmarkConfig.of(SMALL)
    if motions:
        settings = replace(settings, motions=motions)
    if show:
        import yaml

        typer.echo(yaml.safe_dump(settings.as_dict(), sort_keys=False), nl=False)
        return
    data = load_motions(settings.motions, settings.fps)
    kept = f"finished cells are kept in {out}; the same command goes on from there"
    with interruptible(kept), _cells() as (progress, inside):
        results = run_benchmark(
            settings,
            out,
            workers=workers,
            motions=data,
            parquet=parquet,
            command=typed_command(),
            progress=progress,
            inside=inside,
        )
    page = write_benchmark_report(results, data, out)
    if results.select(kind="episodes").rows:
        print_table(summary_table(results.select(kind="episodes")))
    for failure in results.about["failures"]:
        last = failure["trace"].strip().splitlines()[-1]
        console(stderr=True).print(f"failed: {failure['cell']}: {last}", style="red", markup=False, soft_wrap=True)
    console().print(f"\nReport: [bold]{page}[/]", soft_wrap=True)
    if results.about["failures"]:
        raise typer.Exit(code=1)


SMALL = {
    "motions": "embedded",
    "fps": 10,
    "routes": ["adult>pepper", "adult>kid>pepper", "kid>pepper", "kid>adult>pepper"],
    "methods": ["syda", "nearest"],
    "folds": 3,
}
"""What `syda-gym benchmark` without a file computes: two methods, four chains, three groups of held-out actions."""


def compare(
    first: Annotated[Path, typer.Argument(help="Folder of a benchmark: A.")],
    second: Annotated[Path, typer.Argument(help="Folder of another one: B.")],
    figure: Annotated[str, typer.Option(help="Which figure to compare.")] = "landmark_error",
    any_agent: Annotated[bool, typer.Option("--any-agent", help="Agents of A and B may differ.")] = False,
) -> None:
    """Compare two results episode by episode: A minus B, with a verdict only where the interval leaves out zero."""
    from syda_gym.evaluation.benchmark import compare as compare_results
    from syda_gym.evaluation.benchmark import read_results
    from syda_gym.evaluation.benchmark.compare import comparison_table

    found = compare_results(
        read_results(first),
        read_results(second),
        figure,
        labels=(str(first), str(second)),
        ignore=("agent",) if any_agent else (),
    )
    metres = figure in ("landmark_error", "mapping_error", "bound")
    print_table(comparison_table(found, 100.0 if metres else 1.0, "cm" if metres else "", 2 if metres else 4))


def export_episodes(
    name: Annotated[str, typer.Argument(help="Name of the data set, for example `syda/adult-pepper-v0`.")],
    motions: MotionsOption = "embedded",
    route: Annotated[str, typer.Option(help="Chain, for example `adult>kid>pepper`.")] = "adult>pepper",
    method: Annotated[str, typer.Option(help="Mapping method, with a preset behind a colon.")] = "syda",
    agent: Annotated[str, typer.Option(help="`base` or a classical rival.")] = "base",
    disturbance: Annotated[str, typer.Option(help="`none` or a preset such as `teleop:full:test`.")] = "none",
    episodes: Annotated[int, typer.Option(help="How many episodes; 0 for one a clip.", min=0)] = 0,
    seed: Annotated[int, typer.Option(help="Seed of everything random.", min=0)] = 0,
) -> None:
    """Write episodes as a Minari data set, for offline learning (extra `data`)."""
    from syda_gym.evaluation.minari_export import export_minari

    with interruptible("no data set was written; run the command again"):
        stored = export_minari(
            name, motions=motions, route=route, method=method, agent=agent, disturbance=disturbance, episodes=episodes,
            seed=seed, command=typed_command(),
        )  # fmt: skip
    console().print(f"{stored.episodes} episodes, {stored.steps} steps: [bold]{stored.path}[/]", soft_wrap=True)


def suggest(
    bodies: Annotated[
        list[str] | None, typer.Argument(help="Bodies of your lab; all recorded ones by default.")
    ] = None,
    pairs: Annotated[
        list[str] | None, typer.Option("--pair", help="A pair `A:B` that is fitted; may be repeated.")
    ] = None,
    motions: MotionsOption = "embedded",
    count: Annotated[int, typer.Option(help="How many suggestions.", min=1)] = 5,
    results: Annotated[
        Path | None, typer.Option("--benchmark", help="A benchmark with a sample-efficiency curve.")
    ] = None,
    recorded: Annotated[int, typer.Option(help="Paired actions that the new body has so far.", min=0)] = 1,
) -> None:
    """Say which pair to record next, and whether a new body should chain or be recorded with the robot."""
    from syda_gym.errors import StorageError
    from syda_gym.evaluation.benchmark import read_results
    from syda_gym.evaluation.benchmark.efficiency import efficiency_curve
    from syda_gym.evaluation.prediction.tables import suggestions_table
    from syda_gym.motions.loading import load_motions
    from syda_gym.routes.suggestion import spanning_pairs
    from syda_gym.routes.suggestion import suggest as rank

    fitted = [_pair(text) for text in pairs or ()]
    known: list[Any] = list(bodies or load_motions(motions).bodies.values())
    print_table(suggestions_table(rank(known, fitted)[:count], spanning_pairs(known, fitted)))
    if results is None:
        return
    curve = efficiency_curve(read_results(results))
    if curve is None:
        raise StorageError(
            f"{results} has no sample-efficiency curve; add `efficiency:` to its configuration and run again"
        )
    print_table(curve.table())
    console().print(curve.advice(recorded), style="bold", soft_wrap=True)


def _pair(text: str) -> tuple[str, str]:
    from syda_gym.errors import OptionError

    if text.count(":") != 1:
        raise OptionError(f"--pair takes two bodies as A:B, for example adult:kid; got {text!r}")
    first, second = text.split(":")
    return first, second


@contextmanager
def _cells() -> Iterator[tuple[Callable[[int, int, str], None], Callable[[float, str], None]]]:
    """A progress bar over cells that moves within them, too."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), TextColumn("{task.fields[cells]}"), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=console(stderr=True)) as bar:
        task = bar.add_task("", total=None, cells="")
        finished = 0

        def progress(done: int, count: int, name: str) -> None:
            nonlocal finished
            finished = done
            bar.update(task, completed=done, total=count, description=name, cells=f"{done}/{count}")

        yield progress, lambda part, name: bar.update(task, completed=finished + part, description=name)
