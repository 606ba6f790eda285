"""The commands that deal with recordings: ``motions info``, ``check``, ``convert``, ``pair`` and ``formats``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from syda_gym.cli.shared import (
    console,
)

__all__ = ["motions_app"]

motions_app = typer.Typer(help="Look at recordings, check paired data sets, convert them.", no_args_is_help=True)


_Joints = Annotated[
    list[str] | None,
    typer.Option(
        "--joints", help="Which joint is which: `LShoulder=NAME`, a number, or columns `X,Y,Z`.", metavar="JOINT=PLACE"
    ),
]
_Unit = Annotated[str | None, typer.Option(help="Unit of length of the file: m, cm, mm, in, ft, or metres per unit.")]
_Up = Annotated[str | None, typer.Option(help="Axis of the file that points up: y, z, -y, ...")]
_Person = Annotated[int | None, typer.Option(help="Which of several people, from 1.", min=1)]
_Layout = Annotated[Path | None, typer.Option(help="A YAML file that describes a format of your own.")]


def _told(
    joints: list[str] | None, unit: str | None, up: str | None, person: int | None, layout: Path | None
) -> dict[str, Any]:
    """What a person says about a recording, as ``load_motions`` takes it."""
    from syda_gym.errors import OptionError

    pairs = [text.partition("=") for text in joints or ()]
    for name, sign, place in pairs:
        if not sign or not name or not place:
            raise OptionError(f"--joints {name}{sign}{place}: expected JOINT=PLACE, for example LShoulder=LeftArm")
    return {
        "joints": {name: place for name, _, place in pairs} or None,
        "unit": unit,
        "up": up,
        "person": person,
        "layout": layout,
    }


@motions_app.command("info")
def _motions_info(
    spec: Annotated[str, typer.Argument(help="`embedded`, `format:PATH`, or a path.", metavar="SPEC")],
    picture: Annotated[Path | None, typer.Option(help="PNG to draw stick figures into.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    fps: Annotated[float | None, typer.Option(help="Frames per second, if the file does not say.")] = None,
    joints: _Joints = None,
    unit: _Unit = None,
    up: _Up = None,
    person: _Person = None,
    layout: _Layout = None,
) -> None:
    """Say what a recording holds: bodies, actions, rate, gaps, and the units and axes that were found."""
    import json
    import warnings

    from rich.table import Table

    from syda_gym.motions import MotionWarning, describe, load_motions

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MotionWarning)  # the notes below say the same
        loaded = load_motions(spec, fps=fps, **_told(joints, unit, up, person, layout))
        info = describe(loaded, picture=picture)
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
    joints: _Joints = None,
    unit: _Unit = None,
    up: _Up = None,
    person: _Person = None,
    layout: _Layout = None,
) -> None:
    """Convert a recording into a motion file or a data set folder."""
    from syda_gym.embodiments import HumanSkeleton, catalog
    from syda_gym.errors import EmbodimentError
    from syda_gym.motions import conformed, load_motions, save_motions, write_dataset

    motions = load_motions(spec, fps=fps, **_told(joints, unit, up, person, layout))
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
