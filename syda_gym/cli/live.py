"""The commands that deal with the user's own robot: ``robot``, ``teleop`` and ``record``; registered by ``cli``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.cli import checks
from syda_gym.cli.groups.reading import Reading, with_reading
from syda_gym.cli.options import (
    DEFAULT_VIEW,
    ActionOption,
    AppearanceOption,
    AxesOption,
    CalibrationOption,
    MappingOption,
    MethodOption,
    ModelOption,
    MotionsOption,
    NewRecordingOption,
    OperatorOption,
    OwnMotionsOption,
    PictureOption,
    PresetOption,
    RobotOption,
    RouteOption,
    SeedOption,
    SinkOption,
    SourceOption,
    TokenOption,
    ViewAddressOption,
    ViewOption,
    ends_of,
    mapping_of,
    route_of,
)
from syda_gym.cli.shared import console, say_written, show_table
from syda_gym.cli.spellings import Program

if TYPE_CHECKING:
    from syda_gym.embodiments.robot import Robot
    from syda_gym.teleoperation.session import Session
    from syda_gym.teleoperation.view.cockpit import Cockpit

__all__ = ["record", "robot_app", "teleop"]

robot_app = Program(help="Add your own robot, look at it, list those that are known.", no_args_is_help=True)


@robot_app.command("add")
def _robot_add(
    urdf: Annotated[Path, typer.Argument(help="Any URDF (or xacro, MJCF, or a description of yours).")],
    name: Annotated[str | None, typer.Option(help="The new name; by default the file's.")] = None,
    left: Annotated[str | None, typer.Option(help="Link at the end of the left arm, if the search is wrong.")] = None,
    right: Annotated[str | None, typer.Option(help="Link at the end of the right arm.")] = None,
    torso: Annotated[str | None, typer.Option(help="Link in whose frame landmarks are expressed.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite a robot that was added before.")] = False,
    suggest: Annotated[bool, typer.Option(help="Also say which pair to record next.")] = True,
    view: ViewOption = False,
    view_address: ViewAddressOption = DEFAULT_VIEW,
    appearance: AppearanceOption = None,
) -> None:
    """Find arms, hands and torso of a URDF, propose landmarks and a rest pose, and make it known by name."""
    import math

    from syda_gym.teleoperation.setup.robot_setup import add_robot

    added = add_robot(urdf, name, left=left, right=right, torso=torso, replace_existing=replace)
    _print_robot(added.robot)
    say = console()
    verdict = added.verdict
    colour = {"good": "green", "fair": "yellow", "doubtful": "red"}[verdict.word]
    say.print(
        f"[{colour}]{verdict.word}[/]: it points its limbs as a person does within "
        f"{math.degrees(verdict.error):.1f} degrees on average (upper arms "
        f"{math.degrees(verdict.upper):.1f}, forearms {math.degrees(verdict.fore):.1f})"
    )
    if verdict.reason:
        say.print(f"likely reason: {verdict.reason}", markup=False)
    for notice in added.notices:
        say.print(f"- {notice}", markup=False)
    say_written("description", added.description, "(edit it if something is wrong)")
    say_written("picture", added.picture, "(the coloured arms must lie on the robot's)")
    say.print(
        f"try it: syda-gym teleop --robot {added.robot.name} --method geometric --action wave_side --seconds 8 "
        f"--sink video:{added.robot.name}.mp4",
        soft_wrap=True,
    )
    if suggest:
        from syda_gym.routes.suggestion import suggest as rank

        bodies = ["adult", "kid", "pepper", added.robot.name]
        known = [("adult", "kid"), ("kid", "pepper"), ("adult", "pepper")]
        people = {"adult", "kid"}  # a recording session pairs a person with a robot
        pairs = [choice.pair for choice in rank(bodies, known) if people & set(choice.pair)]
        best = next(pair for pair in pairs if added.robot.name in pair)
        say.print(f"record next: {best[0]} with {best[1]} (of the pairs with a person it connects most)")
    if view:
        from syda_gym.cli.viewing import view_robot

        view_robot(added.robot, view_address, appearance)


@robot_app.command("show")
def _robot_show(
    name: Annotated[str, typer.Argument(help="A robot's name, or the path of its description.")],
    picture: PictureOption = None,
) -> None:
    """Show what is known about a robot; draws its picture anew after you have edited its description."""
    from syda_gym.embodiments import catalog
    from syda_gym.embodiments.robot import Robot
    from syda_gym.errors import EmbodimentError
    from syda_gym.teleoperation.setup.robot_picture import draw_robot

    body = catalog.resolve(name)
    if not isinstance(body, Robot):
        raise EmbodimentError(f"{name!r} is a {body.kind}; robots can be shown")
    _print_robot(body)
    drawn = draw_robot(body, picture or catalog.user_folder() / f"{body.name}.png")
    say_written("picture", drawn)


@robot_app.command("list")
def _robot_list() -> None:
    """List the robots that every command takes by name."""
    from syda_gym.embodiments import catalog
    from syda_gym.embodiments.robot import Robot
    from syda_gym.errors import SydaError

    rows = []
    for name in catalog.names():
        try:
            body = catalog.get(name)
        except SydaError as error:
            rows.append((name, "", "", "", str(error)))
            continue
        if isinstance(body, Robot):
            rows.append((name, "+".join(body.sides), str(body.n_features), f"{body.reach:.3f}", str(body.urdf)))
    show_table(("name", "arms", "joints", "reach [m]", "URDF"), rows)


@with_reading
def teleop(
    operator: OperatorOption = None,
    robot: RobotOption = None,
    source: SourceOption = "replay:embedded",
    sink: SinkOption = None,
    method: MethodOption = None,
    preset: PresetOption = None,
    mapping: MappingOption = None,
    route: RouteOption = "auto",
    motions: OwnMotionsOption = None,
    action: ActionOption = None,
    speed: Annotated[
        float, typer.Option(help="Speed of a replay.", callback=checks.between(0.0, 1000.0, open_low=True))
    ] = 1.0,
    repeat: Annotated[bool, typer.Option("--repeat", help="A replay begins again at its end.")] = False,
    calibration: CalibrationOption = 2.0,
    axes: AxesOption = "kinect",
    rate: Annotated[
        float,
        typer.Option(help="Commands per second while no frame comes [Hz].", callback=checks.between(1.0, 1000.0, "Hz")),
    ] = 30.0,
    limit: Annotated[
        float,
        typer.Option(help="Share of the joints' speed limits that may be used.", callback=checks.between(0.01, 1.0)),
    ] = 1.0,
    bound_slow: Annotated[
        float | None,
        typer.Option(
            help="Error bound [m] from which the robot slows.", callback=checks.between(0.0, 10.0, "m", open_low=True)
        ),
    ] = None,
    bound_hold: Annotated[
        float | None,
        typer.Option(
            help="Error bound [m] from which it holds.", callback=checks.between(0.0, 10.0, "m", open_low=True)
        ),
    ] = None,
    token_file: TokenOption = None,
    origin: Annotated[list[str] | None, typer.Option(help="Web page that may connect to a WebSocket.")] = None,
    journal: Annotated[
        Path | None,
        typer.Option(
            help="Write every decision to this `.jsonl` or `.jsonl.gz`, which replays, or to this `.mcap` for Foxglove "
            "and Rerun (extra `ros`).",
            callback=checks.ending(".jsonl", ".jsonl.gz", ".mcap"),
        ),
    ] = None,
    replay_journal: Annotated[
        Path | None, typer.Option("--check-journal", help="Decide a journal anew and compare, instead of a live run.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(help="End after this time [s].", callback=checks.between(0.0, 1e9, "s", open_low=True)),
    ] = None,
    seed: SeedOption = 0,
    view: ViewOption = False,
    view_address: ViewAddressOption = DEFAULT_VIEW,
    appearance: AppearanceOption = None,
    model: ModelOption = None,
    *,
    reading: Reading,
) -> None:
    """Drive a robot live: calibrate, map, filter, keep to limits and speeds, avoid self-collision, send.

    What is said of a recording (`--joints`, `--unit`, ...) is said of the one that `--source replay:FILE` plays.
    """
    from syda_gym.routes.piloting.choice import choose_mapping
    from syda_gym.teleoperation.addresses import read_token
    from syda_gym.teleoperation.journal import replay_journal as decide_anew
    from syda_gym.teleoperation.session import teleoperate
    from syda_gym.teleoperation.tick import LoopSettings

    say = console()
    how = reading.how()
    leader, follower = ends_of(operator, robot, route)
    named, preset = mapping_of(method, preset, mapping)
    stored_or_method = named if method or preset or mapping else "auto"
    with say.status("choosing or fitting the mapping"):
        chosen, notices = choose_mapping(
            leader,
            follower,
            mapping=stored_or_method,
            preset=preset,
            route=route_of(route),
            motions=motions,
            seed=seed,
        )
    for notice in notices:
        say.print(f"- {notice}", markup=False)
    if replay_journal is not None:
        report = decide_anew(replay_journal, chosen)
        where = "" if report.exact else f"; the first other one is in line {report.first_difference}"
        say.print(f"{report.same} of {report.ticks} decisions are the same, bit for bit{where}")
        if report.damage:
            say.print(f"[red]the journal is not whole[/]: {report.damage}")
        raise typer.Exit(code=0 if report.exact and not report.damage else 1)
    settings = LoopSettings(
        rate=rate, calibration=calibration, axes=axes, speed=limit, bound_slow=bound_slow, bound_hold=bound_hold
    )
    secret = read_token(token_file)
    with _Screen(view_address if view else "", secret, appearance) as screen:
        stats = teleoperate(
            chosen,
            source,
            sink or ["bullet"],
            settings=settings,
            token=secret,
            speed=speed,
            actions=action or (),
            repeat=repeat,
            origins=tuple(origin or ()),
            model=model,
            how=how,
            journal=journal,
            note={"mapping": stored_or_method, "motions": motions, "route": route, "source": source},
            seconds=seconds,
            on_start=screen.start,
            on_decision=screen.update,
        )
    summary = stats.summary()
    say.print(
        f"{summary['commands']} commands for {summary['frames']} frames; latency median "
        f"{summary['latency_p50_ms']:.2f} ms, 99 % {summary['latency_p99_ms']:.2f} ms; states {summary['states']}"
    )
    screen.say_more(say)
    if journal is not None:
        say_written("journal", journal)


def record(
    out: NewRecordingOption = None,
    operator: OperatorOption = None,
    robot: RobotOption = None,
    motions: MotionsOption = "embedded",
    action: ActionOption = None,
    takes: Annotated[int, typer.Option(help="Takes per action.", min=1)] = 1,
    source: SourceOption = "udp:9870",
    sink: SinkOption = None,
    calibration: CalibrationOption = 2.0,
    axes: AxesOption = "kinect",
    countdown: Annotated[
        float,
        typer.Option(help="Seconds in the first pose of each prompt.", callback=checks.between(0.0, 600.0, "s")),
    ] = 2.0,
    token_file: TokenOption = None,
) -> None:
    """Record a pair: the robot plays its motions, a person mimics it, and a data set for `fit` comes out.

    Without `--action` one take of each action is played; without `--sink` a window shows the robot. SPACE stops the
    robot at once, `p` holds it and `g` plays the prompt again, `q` or Ctrl-C ends by way of its rest pose.
    """
    from syda_gym.motions import write_dataset
    from syda_gym.motions.recordings import new_recording
    from syda_gym.teleoperation.addresses import make_sink, make_source, read_token
    from syda_gym.teleoperation.screen import keyboard
    from syda_gym.teleoperation.setup.record_session import RecordingOptions, choose_prompts, record_session

    say = console()
    performer, player = ends_of(operator, robot)
    clips, leader = choose_prompts(motions, player, performer, actions=action or (), takes=takes)
    out = out or new_recording(leader.name, clips[0].body.name)
    token = read_token(token_file)
    listener = make_source(source, leader, token=token, calibration=calibration)
    options = RecordingOptions(calibration=calibration, axes=axes, countdown=countdown)
    with (
        make_sink(sink or ["window"], clips[0].body, token=token) as shown,  # type: ignore[arg-type]
        listener,
        keyboard(listener.inbox) as keys,
    ):
        if keys:
            say.print("> keys: SPACE emergency stop  p pause  g go on  q quit")
        session = record_session(
            listener, shown, clips, leader, options=options, name=out.name, tell=lambda text: say.print(f"> {text}")
        )
    write_dataset(session.motions, out)
    rows = (
        (entry.action, str(entry.recordings), str(entry.frames), f"{entry.lag:+.2f}", f"{entry.correlation:.2f}",
         entry.verdict)
        for entry in session.quality
    )  # fmt: skip
    show_table(("action", "takes", "frames", "lag [s]", "correlation", "verdict"), rows)
    for recording, reason in session.left_out.items():
        say.print(f"- {recording} left out: {reason}", markup=False)
    say_written("written", out, f"(check it: syda-gym motions check {out}, then: syda-gym fit {out})")


class _Screen:
    """The live table, the keyboard and the page of ``teleop``.

    Args:
        page: address of the page; empty for none.
        token: that opens it; a new one if not given.
        appearance: another URDF to show there.
    """

    def __init__(self, page: str, token: str | None, appearance: Path | None) -> None:
        from contextlib import ExitStack

        self._stack = ExitStack()
        self._page, self._token, self._appearance = page, token, appearance
        self._cockpit: Cockpit | None = None
        self._session: Session | None = None
        self._live: Any = None
        self._next = 0.0

    def start(self, session: Session) -> None:
        from rich.live import Live

        from syda_gym.teleoperation.screen import keyboard, status_table

        self._session = session
        if self._page:
            self._cockpit = self._stack.enter_context(self._open_page(session))
            console().print(f"view: {self._cockpit.address}", markup=False, highlight=False, soft_wrap=True)
        self._stack.enter_context(keyboard(session.source.inbox))
        table = status_table(session.loop, session.source, session.statistics)
        self._live = self._stack.enter_context(Live(table, console=console(stderr=True), auto_refresh=False))

    def _open_page(self, session: Session) -> Cockpit:
        from syda_gym.teleoperation.addresses import host_and_port
        from syda_gym.teleoperation.view.cockpit import Cockpit

        host, port = host_and_port(self._page, 8099)
        return Cockpit(
            session.loop, session.source, session.sink, session.statistics, host=host, port=port, token=self._token,
            appearance=self._appearance,
        )  # fmt: skip

    def say_more(self, say: Any) -> None:
        """After the run: where the time of a picture went, and what was recorded."""
        from syda_gym.teleoperation.incoming.camera import PictureSource
        from syda_gym.teleoperation.view.words import latency_words

        if self._session is not None and isinstance(self._session.source, PictureSource):
            say.print(latency_words(self._session.source, self._session.statistics), markup=False)
        if self._cockpit is not None and self._cockpit.recorder.message:
            say.print(self._cockpit.recorder.message, markup=False, soft_wrap=True)

    def update(self, decision: Any) -> None:
        """Twice a second; drawing takes longer than deciding."""
        if self._cockpit is not None:
            self._cockpit.update(decision)
        if self._session is None or decision.now < self._next:
            return
        from syda_gym.teleoperation.screen import status_table

        self._next = decision.now + 0.5
        session = self._session
        self._live.update(status_table(session.loop, session.source, session.statistics), refresh=True)

    def __enter__(self) -> _Screen:
        return self

    def __exit__(self, *_: object) -> None:
        from contextlib import suppress

        with suppress(OSError):  # the terminal was closed; the robot is home all the same
            self._stack.close()


def _print_robot(robot: Robot) -> None:
    import numpy as np

    arms = {arm.side: arm for arm in robot.description.arms}
    rows = (
        (side, ", ".join(arms[side].joints), arms[side].shoulder, arms[side].elbow, arms[side].wrist,
         f"{lengths[0]:.3f} + {lengths[1]:.3f}")
        for side, lengths in zip(robot.sides, robot.arm_lengths, strict=True)
    )  # fmt: skip
    show_table(("arm", "joints", "shoulder", "elbow", "wrist", "lengths [m]"), rows, title=robot.name)
    say = console()
    speed = [f"{value:.1f}" if np.isfinite(value) else "unknown" for value in (robot.speed.min(), robot.speed.max())]
    say.print(
        f"torso {robot.description.torso}; joint speeds {speed[0]} to {speed[1]} rad/s; height {robot.height:.2f} m"
    )
