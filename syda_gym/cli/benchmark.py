"""The commands that compare many chains: ``benchmark``, ``compare`` and ``suggest``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from syda_gym.cli import checks
from syda_gym.cli.names import FIGURES, ticked
from syda_gym.cli.options import (
    BodiesArgument,
    CountOption,
    JsonOption,
    MotionsOption,
    OutFolderOption,
    PairOption,
    WorkersOption,
    pairs_of,
)
from syda_gym.cli.shared import console, counted, interruptible, print_json, print_table, say_written, typed_command

__all__ = ["benchmark", "compare", "suggest"]


def benchmark(
    config: Annotated[Path | None, typer.Argument(help="YAML file; without one a small benchmark is run.")] = None,
    out: OutFolderOption = Path("benchmark"),
    workers: WorkersOption = "1",
    motions: MotionsOption = "",
    parquet: Annotated[bool, typer.Option("--parquet", help="Write Parquet instead of CSV.")] = False,
    show: Annotated[bool, typer.Option("--show", help="Print the configuration with all defaults and stop.")] = False,
) -> None:
    """Play every chain x method x agent x disturbance x seed on held-out actions; goes on where it stopped."""
    from syda_gym.evaluation.benchmark import BenchmarkConfig, run_benchmark
    from syda_gym.evaluation.benchmark.choice import choice_table, route_choices
    from syda_gym.evaluation.benchmark.report import summary_table, write_benchmark_report
    from syda_gym.files import write_json
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
    with interruptible(kept), counted() as (progress, inside):
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
    chosen = route_choices(results, data)
    page = write_benchmark_report(results, data, out, chosen)
    if results.select(kind="episodes").rows:
        print_table(summary_table(results.select(kind="episodes")))
        write_json(out / "choices.json", chosen.as_list())
        if chosen.choices:
            print_table(choice_table(chosen))
    for failure in results.about["failures"]:
        last = failure["trace"].strip().splitlines()[-1]
        console(stderr=True).print(f"failed: {failure['cell']}: {last}", style="red", markup=False, soft_wrap=True)
    say_written("\nReport", page)
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
    figure: Annotated[
        str,
        typer.Option("--figure", help=f"Which figure: {ticked(FIGURES)}.", callback=checks.one_of(FIGURES, "figure")),
    ] = "landmark_error",
    any_agent: Annotated[bool, typer.Option("--any-agent", help="Agents of A and B may differ.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare two results episode by episode: A minus B, with a verdict only where the interval leaves out zero."""
    from dataclasses import asdict

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
    if as_json:
        print_json([asdict(one) for one in found])
        return
    metres = figure in ("landmark_error", "mapping_error", "bound")
    print_table(comparison_table(found, 100.0 if metres else 1.0, "cm" if metres else "", 2 if metres else 4))


def suggest(
    bodies: BodiesArgument = None,
    pairs: PairOption = None,
    motions: MotionsOption = "embedded",
    count: CountOption = 5,
    results: Annotated[
        Path | None, typer.Option("--benchmark", help="A benchmark with a sample-efficiency curve.")
    ] = None,
    recorded: Annotated[
        int, typer.Option("--recorded", help="Paired actions that the new body has so far.", min=0)
    ] = 1,
    as_json: JsonOption = False,
) -> None:
    """Say which pair to record next, and whether a new body should chain or be recorded with the robot."""
    from syda_gym.errors import StorageError
    from syda_gym.evaluation.benchmark import read_results
    from syda_gym.evaluation.benchmark.efficiency import efficiency_curve
    from syda_gym.evaluation.prediction.tables import suggestions_table
    from syda_gym.motions.loading import load_motions
    from syda_gym.routes.suggestion import spanning_pairs
    from syda_gym.routes.suggestion import suggest as rank

    fitted = pairs_of(pairs)
    known: list[Any] = list(bodies or load_motions(motions).bodies.values())
    curve = None if results is None else efficiency_curve(read_results(results))
    if results is not None and curve is None:
        raise StorageError(
            f"{results} has no sample-efficiency curve; add `efficiency:` to its configuration and run again"
        )
    ranked, spanning = rank(known, fitted)[:count], spanning_pairs(known, fitted)
    if as_json:
        print_json({
            "suggestions": [{"pair": s.pair, "gain": s.gain, "sum": s.total} for s in ranked],
            "spanning": spanning.pairs,
            "advice": curve.advice(recorded) if curve else None,
        })  # fmt: skip
        return
    print_table(suggestions_table(ranked, spanning))
    if curve is not None:
        print_table(curve.table())
        console().print(curve.advice(recorded), style="bold", soft_wrap=True, markup=False)
