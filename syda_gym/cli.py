"""The command line: thin; every command calls one public function and prints what it found."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym import cli_agents, cli_benchmark, cli_live
from syda_gym.errors import SydaError

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["app", "console", "main", "print_json", "print_table", "stages"]

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
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
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
        ties = "".join(f"; {' > '.join(other.bodies)} lies within sampling noise" for other in route.ties)
        console().print(f"Route chosen for [bold]{operator}[/]: [bold]{' > '.join(route.bodies)}[/]{ties}")
    print_table(chain_table(result))
    if result.residual:
        print_table(result.residual.table())
    console().print(f"\nReport: [bold]{result.report}[/]  (open it in a browser)")


app.add_typer(cli_live.robot_app, name="robot")


@app.command("reproduce-paper")
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
    from syda_gym.evaluation.paper import reproduce
    from syda_gym.evaluation.paper_report import tables
    from syda_gym.motions.clip import PROTOCOLS

    with stages({"study": "Fitting and scoring"}) as tell:
        study = reproduce(
            motions,
            out,
            seeds=seeds,
            protocols=tuple(protocol) if protocol else PROTOCOLS,
            contenders=method,
            workers=workers,
            progress=lambda fraction, _: tell("study", fraction),
        )
    for table in tables(study):
        print_table(table)
    for name, reason in study.skipped.items():
        console(stderr=True).print(f"left out {name}: {reason}", markup=False)
    console(stderr=True).print(f"tables, plots and study.json are in {out}", markup=False)


app.command()(cli_agents.train)
app.command()(cli_agents.evaluate)
app.command()(cli_agents.play)
app.command()(cli_agents.export)
app.command()(cli_live.teleop)
app.command()(cli_live.record)
app.command()(cli_benchmark.benchmark)
app.command()(cli_benchmark.compare)
app.command()(cli_benchmark.suggest)
app.command("export-episodes")(cli_benchmark.export_episodes)

motions_app = typer.Typer(help="Look at recordings, check paired data sets, convert them.", no_args_is_help=True)
app.add_typer(motions_app, name="motions")


@motions_app.command("info")
def _motions_info(
    spec: Annotated[str, typer.Argument(help="`embedded`, `format:PATH`, or a path.", metavar="SPEC")],
    picture: Annotated[Path | None, typer.Option(help="PNG to draw stick figures into.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what a recording holds: bodies, actions, rate, gaps, and the units and axes that were found."""
    import json
    import warnings

    from rich.table import Table

    from syda_gym.motions import MotionWarning, describe

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MotionWarning)  # the notes below say the same
        info = describe(spec, picture=picture)
    if as_json:
        typer.echo(json.dumps(info.to_dict(), indent=1))
        return
    rate = f"{info.fps[0]:.4g}" if info.fps[0] == info.fps[1] else f"{info.fps[0]:.4g} to {info.fps[1]:.4g}"
    kind = "synthetic, " if info.synthetic else ""
    say = console()
    say.print(
        f"[bold]{info.name}[/]: {kind}{info.takes} takes of {len(info.actions)} actions, {info.frames} frames, "
        f"{info.seconds:.1f} s at {rate} frames per second{', with timestamps' if info.timestamps else ''}"
    )
    units = ("stature\n\\[m]", "upper arm\n\\[m]", "forearm\n\\[m]")
    table = Table("body", "kind", "arms", *units, "frames", "filled", "fastest\n\\[m/s]")
    for body in info.bodies:
        lengths = (f"{body.height:.2f}", f"{body.upper_arm:.3f}", f"{body.forearm:.3f}")
        share = f"{100 * body.filled:.1f} %"
        table.add_row(
            body.name,
            body.kind,
            "both" if len(body.sides) > 1 else body.sides[0],
            *lengths,
            str(body.frames),
            share,
            f"{body.fastest:.1f}",
        )
    say.print(table)
    counts = {count for *_, count in info.pairs}
    if len(info.pairs) > 3 and len(counts) == 1:
        say.print(f"paired frames: {counts.pop()} in each of the {len(info.pairs)} pairs of bodies")
    elif info.pairs:
        say.print("paired frames: " + ", ".join(f"{a}-{b} {count}" for a, b, count in info.pairs))
    if info.families:
        say.print("families: " + ", ".join(info.families))
    say.print("actions: " + ", ".join(info.actions))
    for note in info.notes:
        say.print(f"- {note}", markup=False)
    if picture is not None:
        say.print(f"picture: [bold]{picture}[/]")


@motions_app.command("check")
def _motions_check(
    folder: Annotated[Path, typer.Argument(help="A data set folder with `dataset.json`.")],
) -> None:
    """Check a paired data set: every fault with its place, and how well each action pairs up."""
    from syda_gym.motions import validate_dataset

    findings = validate_dataset(folder)
    say = console()
    colours = {"error": "red", "warning": "yellow", "info": "green"}
    for finding in findings:
        say.print(f"[{colours[finding.level]}]{finding.level:>7}[/]", end=" ")
        say.print(f"{finding.place}: {finding.message}", markup=False, highlight=False, soft_wrap=True)
    errors = sum(finding.level == "error" for finding in findings)
    say.print(f"{errors} errors, {sum(finding.level == 'warning' for finding in findings)} warnings")
    if errors:
        raise typer.Exit(code=1)


@motions_app.command("convert")
def _motions_convert(
    spec: Annotated[str, typer.Argument(help="`embedded`, `format:PATH`, or a path.", metavar="SPEC")],
    out: Annotated[Path, typer.Argument(help="An `.npz` file, or a folder for a data set.")],
    fps: Annotated[float | None, typer.Option(help="Resample to this rate.")] = None,
    operator: Annotated[
        str, typer.Option(help="Re-express `operator` as this human of the catalog, say `adult`.")
    ] = "",
) -> None:
    """Convert a recording into a motion file or a data set folder."""
    from syda_gym.embodiments import HumanSkeleton, catalog
    from syda_gym.errors import EmbodimentError
    from syda_gym.motions import conformed, load_motions, save_motions, write_dataset

    motions = load_motions(spec, fps=fps)
    if operator:
        body = catalog.get(operator)
        if not isinstance(body, HumanSkeleton):
            raise EmbodimentError(f"{operator!r} is a {body.kind}; a recorded operator can only become a human")
        motions = conformed(motions, "operator", body)
    written = save_motions(motions, out) if out.suffix == ".npz" else write_dataset(motions, out)
    console().print(f"written: [bold]{written}[/]")


@motions_app.command("pair")
def _motions_pair(
    operators: Annotated[str, typer.Argument(help="A folder of the operator's recordings, or one file.")],
    prompts: Annotated[str, typer.Argument(help="What the robot played: `embedded`, `format:PATH`, or a path.")],
    out: Annotated[Path, typer.Argument(help="Folder of the new data set.")],
    robot: Annotated[str, typer.Option(help="Whose motions the prompts are.")] = "pepper",
    max_lag: Annotated[float, typer.Option(help="Largest shift in time either way [s].")] = 1.0,
    fps: Annotated[float | None, typer.Option(help="Frames per second of the pairs.")] = None,
    same_clock: Annotated[bool, typer.Option(help="Both have timestamps of one clock.")] = False,
) -> None:
    """Pair an operator's recordings with a robot's prompts by name, align them in time, and judge every action."""
    from rich.table import Table

    from syda_gym.motions import load_motions, operator_clips, pair_session, write_dataset

    played = load_motions(prompts)
    session = pair_session(
        operator_clips(operators), played.clips(robot), fps=fps, max_lag=max_lag, same_clock=same_clock, name=out.name
    )
    write_dataset(session.motions, out)
    table = Table("action", "takes", "frames", "lag \\[s]", "correlation", "amplitude", "verdict")
    for entry in session.quality:
        numbers = (f"{entry.lag:+.2f}", f"{entry.correlation:.2f}", f"{entry.amplitude:.2f}")
        table.add_row(entry.action, str(entry.recordings), str(entry.frames), *numbers, entry.verdict)
    say = console()
    say.print(table)
    say.print("lag, correlation and amplitude are those after alignment", style="dim")
    for recording, found in session.alignments.items():
        say.print(f"- {recording}: shifted by {found.shift} frames ({found.lag:+.2f} s)", markup=False)
    for recording, reason in session.left_out.items():
        say.print(f"- {recording} left out: {reason}", markup=False)
    say.print(f"written: [bold]{out}[/]")


@motions_app.command("formats")
def _motions_formats() -> None:
    """List the formats that can be read."""
    from rich.table import Table

    from syda_gym.motions import FORMATS

    table = Table("prefix", "what", "usual endings")
    for entry in FORMATS.values():
        table.add_row(f"{entry.name}:", entry.description, " ".join(entry.endings))
    console().print(table)


@app.command()
def transferability(
    bodies: Annotated[list[str] | None, typer.Argument(help="Names, URDFs or robot descriptions; all pairs.")] = None,
    definition: Annotated[str, typer.Option(help="`general` or `paper`.")] = "general",
    validate: Annotated[bool, typer.Option("--validate", help="Measure whether it predicts held-out errors.")] = False,
    motions: MotionsOption = "embedded",
    folds: Annotated[int, typer.Option(help="Groups of actions to hold out (`--validate`).", min=2)] = 4,
    max_hops: Annotated[int, typer.Option(help="Longest chain (`--validate`).", min=1)] = 3,
    picture: Annotated[
        Path | None, typer.Option(help="Write clouds and regions of the first pair (or the validation) as PNG.")
    ] = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Measure how well each body can stand in for each other one, term by term."""
    from itertools import permutations

    from syda_gym.embodiments import catalog
    from syda_gym.evaluation.transferability_tables import links_table, prediction_table
    from syda_gym.files import write_bytes
    from syda_gym.transferability.metric import transferability as measure

    if validate:
        from syda_gym.evaluation.prediction import validate as measure_prediction

        with stages({"fit": "Fitting every pair and fold", "chains": "Scoring every chain"}) as tell:
            study = measure_prediction(
                motions, bodies=bodies or None, folds=folds, max_hops=max_hops, seed=seed, progress=tell
            )
        tables = [prediction_table(study), *([prediction_table(study, full=True)] if study.full_scores else [])]
        if picture:
            from syda_gym.evaluation.prediction_picture import prediction_png

            write_bytes(picture, prediction_png(study))
        if as_json:
            print_json(study.as_dict())
        for table in () if as_json else tables:
            print_table(table)
        return
    names = list(bodies or ("adult", "kid", "pepper", "nao"))
    chosen = [
        catalog.resolve(name) for name in (names if len(names) > 1 else [*names, "adult", "kid", "pepper", "nao"])
    ]
    distinct = list({body.name: body for body in chosen}.values())
    pairs = list(permutations(distinct, 2))
    if len(names) == 1:  # one body: how it leads and follows the others
        pairs = [(a, b) for a, b in pairs if distinct[0] in (a, b)]
    kind: Any = definition  # checked, with the nearest name, where it is used
    links = [measure(a, b, kind, seed=seed) for a, b in pairs]
    if picture:
        from syda_gym.transferability.pictures import clouds_png

        write_bytes(picture, clouds_png(*pairs[0], kind, seed=seed))
    print_json([link.as_dict() for link in links]) if as_json else print_table(links_table(links))


@app.command()
def route(
    source: Annotated[str, typer.Option("--from", help="Who leads.")],
    target: Annotated[str, typer.Option("--to", help="Who follows.")],
    pairs: Annotated[
        list[str] | None, typer.Option("--pair", help="A fitted pair `A:B`; may be repeated. Default: all recorded.")
    ] = None,
    motions: MotionsOption = "embedded",
    definition: Annotated[str, typer.Option(help="`general` or `paper`.")] = "general",
    max_hops: Annotated[int | None, typer.Option(help="Longest chain.", min=1)] = None,
    predictor: Annotated[
        str, typer.Option(help="What decides: `T`, `C`, `L`, `coverage`, `hops`, or `measured`.")
    ] = "T",
    count: Annotated[int, typer.Option(help="How many routes to list.", min=1)] = 5,
    noise: Annotated[bool, typer.Option("--noise", help="Take alpha from the noise of the recordings.")] = False,
    suggest: Annotated[bool, typer.Option("--suggest", help="Also say which pair to record next.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Write the graph with the chosen route as PNG.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Choose the chain of bodies from one to another that transferability ranks best."""
    from syda_gym.evaluation.transferability_tables import routes_table, suggestions_table
    from syda_gym.files import write_bytes
    from syda_gym.transferability import routing, suggestion

    kind: Any = definition  # checked, with the nearest name, where it is used
    fitted, bodies = _fitted_pairs(pairs, motions)
    options: dict[str, Any] = {"max_hops": max_hops, "predictor": predictor}
    if predictor == "measured":
        from syda_gym.evaluation.prediction import measure_bodies

        named = [(getattr(a, "name", a), getattr(b, "name", b)) for a, b in fitted]
        with stages({"fit": "Fitting pairs to measure bodies"}) as tell:
            options["predictor"] = measure_bodies(motions, named, progress=tell)
    if noise:
        from syda_gym.evaluation.prediction import motion_noise
        from syda_gym.motions.loading import load_motions
        from syda_gym.transferability.noise import alpha_from_noise

        options["alpha"] = alpha_from_noise(motion_noise(load_motions(motions)))
    best = routing.best_route(source, target, fitted, kind, **options)
    ranked = routing.ranked_routes(source, target, fitted, kind, count=count, **options)
    routes = [best, *(other for other in ranked if other.bodies != best.bodies)][:count]
    further, spanning = None, None
    if suggest:
        further = suggestion.suggest(bodies, fitted, kind, **options)[:count]
        spanning = suggestion.spanning_pairs(
            bodies, (), kind, predictor=options["predictor"], alpha=options.get("alpha")
        )
    if picture:
        from syda_gym.transferability.pictures import graph_png

        graph = routing.BodyGraph((), fitted, kind, predictor=options["predictor"], alpha=options.get("alpha"))
        write_bytes(picture, graph_png(graph, best))
    if as_json:
        print_json({
            "routes": [item.as_dict() for item in routes],
            "suggestions": [{"pair": s.pair, "gain": s.gain, "sum": s.total} for s in further or ()],
            "spanning": spanning.pairs if spanning else [],
        })  # fmt: skip
        return
    print_table(routes_table(routes, predictor))
    if further is not None:
        print_table(suggestions_table(further, spanning))


def _fitted_pairs(pairs: list[str] | None, motions: str) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """Pairs as the user named them, or all that were recorded together; and everybody who can be paired."""
    from syda_gym.errors import OptionError
    from syda_gym.motions.loading import load_motions

    if not pairs:
        recorded = load_motions(motions)
        fitted = [(recorded.bodies[a], recorded.bodies[b]) for a, b in recorded.pairs]
        return fitted, list(recorded.bodies.values())
    for pair in pairs:
        if pair.count(":") != 1:
            raise OptionError(f"--pair takes two bodies as A:B, for example adult:kid; got {pair!r}")
    named = [(pair.split(":")[0], pair.split(":")[1]) for pair in pairs]
    return named, list(dict.fromkeys(name for pair in named for name in pair))


def _command() -> str:
    """The command line as the user wrote it."""
    import shlex

    return shlex.join(["syda-gym", *sys.argv[1:]])
