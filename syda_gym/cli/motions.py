"""The commands that deal with recordings: ``motions info``, ``check``, ``convert``, ``pair`` and ``formats``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.groups.reading import Reading, with_reading
from syda_gym.cli.options import (
    DEFAULT_VIEW,
    JsonOption,
    OutFolderOption,
    PictureOption,
    SpecArgument,
    ViewAddressOption,
    ViewOption,
)
from syda_gym.cli.shared import console, print_json, say_written, show_table
from syda_gym.cli.spellings import Program

__all__ = ["motions_app"]

motions_app = Program(help="Look at recordings, check paired data sets, convert them.", no_args_is_help=True)


@motions_app.command("info")
@with_reading
def _motions_info(
    spec: SpecArgument,
    picture: PictureOption = None,
    as_json: JsonOption = False,
    view: ViewOption = False,
    view_address: ViewAddressOption = DEFAULT_VIEW,
    *,
    reading: Reading,
) -> None:
    """Say what a recording holds: bodies, actions, rate, gaps, and the units and axes that were found."""
    import warnings

    from syda_gym.motions import MotionWarning, describe

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MotionWarning)  # the notes below say the same
        loaded = reading.how().load(spec)
        info = describe(loaded, picture=picture)
    if as_json:
        print_json(info.to_dict())
        return
    rate = f"{info.fps[0]:.4g}" if info.fps[0] == info.fps[1] else f"{info.fps[0]:.4g} to {info.fps[1]:.4g}"
    kind = "synthetic, " if info.synthetic else ""
    say = console()
    say.print(
        f"[bold]{info.name}[/]: {kind}{info.takes} takes of {len(info.actions)} actions, {info.frames} frames, "
        f"{info.seconds:.1f} s at {rate} frames per second{', with timestamps' if info.timestamps else ''}"
    )
    units = ("stature\n[m]", "upper arm\n[m]", "forearm\n[m]")
    rows = []
    for body in info.bodies:
        lengths = (f"{body.height:.2f}", f"{body.upper_arm:.3f}", f"{body.forearm:.3f}")
        share = f"{100 * body.filled:.1f} %"
        arms = "both" if len(body.sides) > 1 else body.sides[0]
        rows.append((body.name, body.kind, arms, *lengths, str(body.frames), share, f"{body.fastest:.1f}"))
    show_table(("body", "kind", "arms", *units, "frames", "filled", "fastest\n[m/s]"), rows)
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
        say_written("picture", picture)
    if view:
        from syda_gym.cli.viewing import view_motions

        view_motions(loaded, view_address)


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
@with_reading
def _motions_convert(
    spec: SpecArgument,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="An `.npz` file, or a folder for a data set.", callback=checks.npz_or_folder),
    ],
    operator: Annotated[
        str, typer.Option(help="Re-express the recorded operator as this human of the catalog, say `adult`.")
    ] = "",
    *,
    reading: Reading,
) -> None:
    """Convert a recording into a motion file or a data set folder."""
    from syda_gym.embodiments import HumanSkeleton, catalog
    from syda_gym.errors import EmbodimentError
    from syda_gym.motions import conformed, save_motions, write_dataset

    motions = reading.how().load(spec)
    if operator:
        body = catalog.get(operator)
        if not isinstance(body, HumanSkeleton):
            raise EmbodimentError(f"{operator!r} is a {body.kind}; a recorded operator can only become a human")
        motions = conformed(motions, "operator", body)
    written = save_motions(motions, out) if out.suffix == ".npz" else write_dataset(motions, out)
    say_written("written", written)


@motions_app.command("pair")
@with_reading
def _motions_pair(
    operators: Annotated[str, typer.Argument(help="A folder of the operator's recordings, or one file.")],
    prompts: Annotated[str, typer.Argument(help="What the robot played: `embedded`, `format:PATH`, or a path.")],
    out: OutFolderOption,
    robot: Annotated[str, typer.Option("--robot", help="Who follows: whose motions the prompts are.")] = "pepper",
    max_lag: Annotated[
        float,
        typer.Option(
            help="Largest shift in time either way [s].", callback=checks.between(0.0, 60.0, "s", open_low=True)
        ),
    ] = 1.0,
    same_clock: Annotated[bool, typer.Option(help="Both have timestamps of one clock.")] = False,
    *,
    reading: Reading,
) -> None:
    """Pair an operator's recordings with a robot's prompts by name, align them in time, and judge every action.

    What is said of the file (`--joints`, `--unit`, ...) is said of all the operator's recordings, not of the prompts;
    `--fps` is the rate of the pairs, too.
    """
    from syda_gym.motions import load_motions, operator_clips, pair_session, write_dataset

    how = reading.how()
    played = load_motions(prompts).clips(robot)
    # Files of one clock have times, which a new rate would take away before they are compared.
    clips = operator_clips(operators, how=replace(how, fps=None) if same_clock else how)
    session = pair_session(clips, played, fps=how.fps, max_lag=max_lag, same_clock=same_clock, name=out.name)
    write_dataset(session.motions, out)
    rows = []
    for entry in session.quality:
        numbers = (f"{entry.lag:+.2f}", f"{entry.correlation:.2f}", f"{entry.amplitude:.2f}")
        rows.append((entry.action, str(entry.recordings), str(entry.frames), *numbers, entry.verdict))
    headings = ("action", "takes", "frames", "lag [s]", "correlation", "amplitude", "verdict")
    show_table(headings, rows, note="lag, correlation and amplitude are those after alignment")
    say = console()
    for recording, found in session.alignments.items():
        say.print(f"- {recording}: shifted by {found.shift} frames ({found.lag:+.2f} s)", markup=False)
    for recording, reason in session.left_out.items():
        say.print(f"- {recording} left out: {reason}", markup=False)
    say_written("written", out)


@motions_app.command("formats")
def _motions_formats() -> None:
    """List the formats that can be read."""
    from syda_gym.motions import FORMATS

    rows = ((f"{entry.name}:", entry.description, " ".join(entry.endings)) for entry in FORMATS.values())
    show_table(("prefix", "what", "usual endings"), rows)
