"""Options that several commands have: each thing has one spelling, one meaning, one check and one help text."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.names import (
    ACTING,
    AXES,
    BODIES,
    CELLS,
    DEFINITIONS,
    FORMATS,
    LEVELS,
    METHODS,
    PRESETS,
    RIVALS,
    SINGLE_DISTURBANCES,
    SINKS,
    SOURCES,
    ticked,
)
from syda_gym.errors import nearest_name

__all__ = [
    "AGENT_HELP",
    "DEFAULT_VIEW",
    "ActionOption",
    "AgentOption",
    "AppearanceOption",
    "AxesOption",
    "BodiesArgument",
    "CalibrationOption",
    "CountOption",
    "DefinitionOption",
    "DisturbancesOption",
    "FpsOption",
    "HeldOutOption",
    "JointsOption",
    "JsonOption",
    "LayoutOption",
    "MappingOption",
    "MaxHopsOption",
    "MethodOption",
    "MethodsOption",
    "ModelOption",
    "MotionsOption",
    "NewRecordingOption",
    "OperatorOption",
    "OutFolderOption",
    "OwnMotionsOption",
    "PairOption",
    "PersonOption",
    "PhysicsHzOption",
    "PictureOption",
    "PresetOption",
    "RobotOption",
    "RouteOption",
    "SeedOption",
    "SensorOption",
    "SinkOption",
    "SourceOption",
    "SpecArgument",
    "TokenOption",
    "UnitOption",
    "UpOption",
    "ViewAddressOption",
    "ViewOption",
    "WorkersOption",
    "ends_of",
    "mapping_of",
    "pairs_of",
    "route_of",
    "sensors_of",
]

_SPEC = f"`embedded`, a path, or `FORMAT:PATH` with one of {ticked(FORMATS)}."
_BODY = f"{ticked(BODIES)}, one of the motions, or a robot that was added."
_METHOD_HELP = "; ".join(
    f"`{name}`" + (f" ({', '.join(presets)})" if len(presets) > 1 else "") for name, presets in METHODS.items()
)

MotionsOption = Annotated[str, typer.Option("--motions", "-m", help=f"Recordings: {_SPEC}", metavar="SPEC")]
SpecArgument = Annotated[str, typer.Argument(help=f"A recording: {_SPEC}", metavar="SPEC")]
OwnMotionsOption = Annotated[
    str | None,
    typer.Option("--motions", "-m", help=f"Fitted on; by default what you recorded: {_SPEC}", metavar="SPEC"),
]
NewRecordingOption = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder of the data set; by default where `fit` and `teleop` look.")
]
OutFolderOption = Annotated[
    Path, typer.Option("--out", "-o", help="Folder to write to; created if need be.", callback=checks.folder)
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0, max=2**32 - 1)]
PictureOption = Annotated[
    Path | None, typer.Option("--picture", help="Also draw it into this PNG.", callback=checks.ending(".png"))
]
WorkersOption = Annotated[
    str,
    typer.Option(
        "--workers", "-w", help="Processes on this machine, `ray` or `ray:ADDRESS`.", metavar="N",
        callback=checks.workers,
    ),
]  # fmt: skip

OperatorOption = Annotated[
    str | None,
    typer.Option("--operator", help=f"Who leads: {_BODY} Default: `adult`, or the first body of `--route`."),
]
RobotOption = Annotated[
    str | None,
    typer.Option("--robot", help=f"Who follows: {_BODY} Default: `pepper`, or the last body of `--route`."),
]
RouteOption = Annotated[
    str,
    typer.Option(
        "--route", help="`auto` (the best one), or bodies such as `adult,kid,pepper`.", metavar="A,B,C",
        callback=checks.route,
    ),
]  # fmt: skip
PairOption = Annotated[
    list[str] | None,
    typer.Option("--pair", help="A fitted pair; repeatable or comma-separated.", metavar="A:B", callback=checks.pairs),
]
BodiesArgument = Annotated[list[str] | None, typer.Argument(help=f"Bodies: {_BODY} Also a URDF or a description.")]

MethodOption = Annotated[
    str | None,
    typer.Option(
        "--method", help=f"How mappings are made: {_METHOD_HELP}; in brackets the presets. Default: `syda`.",
        metavar="NAME[:PRESET]", callback=checks.methods,
    ),
]  # fmt: skip
MethodsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--method", help=f"Only these, repeatable or comma-separated: {_METHOD_HELP}; in brackets the presets.",
        metavar="NAME[:PRESET]", callback=checks.methods,
    ),
]  # fmt: skip
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset", help="The mapping's preset; short for `--method NAME:PRESET`.",
        callback=checks.one_of(PRESETS, "preset of a mapping"),
    ),
]  # fmt: skip
MappingOption = Annotated[
    Path | None, typer.Option("--mapping", help="A stored mapping, or a folder of them, instead of `--method`.")
]
HeldOutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--held-out", help="Actions that no fit may see; repeatable or comma-separated.", metavar="ACTION",
        callback=checks.several(),
    ),
]  # fmt: skip
ActionOption = Annotated[
    list[str] | None,
    typer.Option(
        "--action", help="Only this action; repeatable or comma-separated.", metavar="ACTION",
        callback=checks.several(),
    ),
]  # fmt: skip
DisturbancesOption = Annotated[
    str,
    typer.Option(
        "--disturbances",
        help=f"`none`; `teleop:CELL:LEVEL` with CELL {ticked(CELLS)} and LEVEL {ticked(LEVELS)}; "
        f"or `NAME:LEVEL` with NAME {ticked(SINGLE_DISTURBANCES)}.",
        callback=checks.disturbances,
    ),
]
AgentOption = Annotated[
    str, typer.Option("--agent", help=f"Who acts: {ticked(RIVALS)}.", callback=checks.one_of(RIVALS, "agent"))
]
AGENT_HELP = f"A bundle's path, a rival ({ticked(RIVALS)}) or a shipped agent ({ticked(ACTING[len(RIVALS) :])})."
"""What stands in the help of an argument that takes any agent."""

DefinitionOption = Annotated[
    str | None,
    typer.Option(
        "--definition", help=f"Of transferability: {ticked(DEFINITIONS)}.",
        callback=checks.one_of(DEFINITIONS, "definition"),
    ),
]  # fmt: skip
SensorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sensor", help="Noise of a body's landmarks in the dry run [m], repeatable: `kid=0.015`.", metavar="BODY=M"
    ),
]
CountOption = Annotated[int, typer.Option("--count", help="How many to list at most.", min=1)]
MaxHopsOption = Annotated[int | None, typer.Option("--max-hops", help="Longest chain, in links.", min=1)]
PhysicsHzOption = Annotated[
    float,
    typer.Option(
        "--physics-hz", help="Physics steps per second [Hz], a multiple of 30.",
        callback=checks.multiple(30.0, 30.0, 10_000.0, "Hz"),
    ),
]  # fmt: skip

FpsOption = Annotated[
    float | None,
    typer.Option("--fps", help="Frames per second.", callback=checks.between(0.0, 1000.0, "Hz", open_low=True)),
]
SourceOption = Annotated[
    str,
    typer.Option(
        "--source", help=f"Where frames come from: {ticked(SOURCES)}.", callback=checks.address(SOURCES, "source")
    ),
]
SinkOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sink", help=f"Where commands go, repeatable: {ticked(SINKS)}.", callback=checks.address(SINKS, "sink")
    ),
]
AxesOption = Annotated[
    str,
    typer.Option("--axes", help=f"The source's axes: {ticked(AXES)}.", callback=checks.one_of(AXES, "axes")),
]
CalibrationOption = Annotated[
    float,
    typer.Option(
        "--calibration", help="Seconds of standing; 0 trusts the source.", callback=checks.between(0.0, 60.0, "s")
    ),
]
TokenOption = Annotated[
    Path | None, typer.Option("--token-file", help="File with the secret that packets carry beyond this machine.")
]

DEFAULT_VIEW = "127.0.0.1:8099"
ViewOption = Annotated[bool, typer.Option("--view", help="Show it live on a page in the browser (extra `view`).")]
ViewAddressOption = Annotated[
    str, typer.Option("--view-address", help="Where the page listens; port 0 takes any that is free.")
]
AppearanceOption = Annotated[
    Path | None,
    typer.Option("--appearance", help="Another URDF of the robot to show on the page, say the vendor's with meshes."),
]
ModelOption = Annotated[
    Path | None, typer.Option("--model", help="Pose model of cameras and films, a `.task` file (extra `camera`).")
]

JointsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--joints", help="Which joint is which: `LShoulder=NAME`, a number, or columns `X,Y,Z`.", metavar="JOINT=PLACE"
    ),
]
UnitOption = Annotated[
    str | None, typer.Option("--unit", help="Unit of length of the file: m, cm, mm, in, ft, or metres per unit.")
]
UpOption = Annotated[str | None, typer.Option("--up", help="Axis of the file that points up: y, z, -y, ...")]
PersonOption = Annotated[int | None, typer.Option("--person", help="Which of several people, from 1.", min=1)]
LayoutOption = Annotated[Path | None, typer.Option("--layout", help="A YAML file that describes a format of your own.")]


def route_of(text: str) -> str | tuple[str, ...]:
    """What ``--route`` gave, as the library takes it: ``"auto"`` or the bodies."""
    return text if text in ("", "auto") else tuple(text.replace(">", ",").split(","))


def ends_of(operator: str | None, robot: str | None, route: str = "auto") -> tuple[str, str]:
    """Operator and robot: as given, else the ends of the route, else ``adult`` and ``pepper``."""
    bodies = route_of(route)
    first, last = (bodies[0], bodies[-1]) if isinstance(bodies, tuple) else ("adult", "pepper")
    return operator or first, robot or last


def pairs_of(values: list[str] | None) -> list[tuple[str, str]]:
    """What ``--pair`` gave as pairs of names."""
    return [(first.strip(), second.strip()) for first, second in (text.split(":") for text in values or ())]


def mapping_of(method: str | None, preset: str | None, mapping: Path | None) -> tuple[str, str | None]:
    """What ``--method``, ``--preset`` and ``--mapping`` say together.

    Returns:
        A method or the path of what is stored, as ``mapping=`` takes it, and the preset.

    Raises:
        typer.BadParameter: a path where nothing is, or options that contradict each other.
    """
    if mapping is not None:
        if method or preset:
            raise typer.BadParameter(
                "a stored mapping has its method; leave --method and --preset out", param_hint="'--mapping'"
            )
        if not mapping.exists():
            names = nearest_name(str(mapping), METHODS)
            raise typer.BadParameter(
                f"nothing is stored in {mapping}; a method is named with --method: {names}", param_hint="'--mapping'"
            )
        return str(mapping), None
    name, _, inner = (method or "syda").partition(":")
    if preset and inner and preset != inner:
        raise typer.BadParameter(f"--method {method} and --preset {preset} name two presets", param_hint="'--preset'")
    chosen = inner or preset or None
    if chosen is not None and chosen not in METHODS[name]:
        raise typer.BadParameter(
            f"method {name!r} has no preset {chosen!r}; {nearest_name(chosen, METHODS[name])}", param_hint="'--preset'"
        )
    return name, chosen


def sensors_of(values: list[str] | None) -> dict[str, float] | None:
    """``BODY=M`` as body to metres.

    Raises:
        BadParameter: something else.
    """
    found: dict[str, float] = {}
    for text in values or ():
        name, _, number = text.partition("=")
        try:
            found[name] = float(number)
        except ValueError:
            raise typer.BadParameter(
                f"expected BODY=METRES such as kid=0.015, got {text!r}", param_hint="'--sensor'"
            ) from None
    return found or None
