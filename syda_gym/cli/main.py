"""The ``syda-gym`` program: every command registered, and how errors and interrupts end."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Annotated

import typer

from syda_gym.cli import benchmark, fit, live, motions, routes, studies
from syda_gym.cli.acting import agents, data_sets, journals, tune
from syda_gym.cli.shared import Interrupted, console
from syda_gym.cli.spellings import Program
from syda_gym.errors import SydaError

__all__ = ["app", "main"]

app = Program(
    name="syda-gym",
    help="Map a human's motion onto a humanoid, chain such maps, know which chain will work, and prove how good it is.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def main() -> None:
    """Runs the command line; an error of the library is one clear line and exit code 2.

    Ctrl-C and a request to terminate are one line, too, that says where to go on; their exit codes are 130 and 143.
    """
    stopped_by: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopped_by.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)
    try:
        app(prog_name="syda-gym")
    except SydaError as error:
        console(stderr=True).print(f"error: {error}", style="bold red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except Interrupted as interrupt:
        _say_interrupted(str(interrupt))
        sys.exit(128 + interrupt.signal)
    except SystemExit as end:
        if end.code == 128 + signal.SIGINT:  # Typer's own answer to Ctrl-C, which says nothing
            _say_interrupted("nothing was kept; run the command again")
            sys.exit(128 + (stopped_by or [signal.SIGINT])[0])
        raise
    except KeyboardInterrupt:
        _say_interrupted("")
        sys.exit(128 + (stopped_by or [signal.SIGINT])[0])


def _say_interrupted(where: str) -> None:
    text = f"interrupted: {where}" if where else "interrupted"
    console(stderr=True).print(text, style="bold red", markup=False, highlight=False, soft_wrap=True)


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


app.command()(studies.demo)
app.command("reproduce-paper")(studies.reproduce_paper)
app.command()(routes.transferability)
app.command()(routes.route)
app.command()(agents.train)
app.command()(tune.tune)
app.command()(agents.evaluate)
app.command()(agents.play)
app.command()(agents.export)
app.command()(fit.fit)
app.command()(live.teleop)
app.command()(live.record)
app.command()(benchmark.benchmark)
app.command()(benchmark.compare)
app.command()(benchmark.suggest)
app.command("export-episodes")(data_sets.export_episodes)
app.add_typer(live.robot_app, name="robot")
app.add_typer(journals.journal_app, name="journal")
app.add_typer(motions.motions_app, name="motions")
