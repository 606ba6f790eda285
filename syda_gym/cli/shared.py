"""What all commands share: options, the console, tables, progress; knows no command."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

__all__ = [
    "Interrupted",
    "JsonOption",
    "MotionsOption",
    "OutOption",
    "SeedOption",
    "console",
    "interruptible",
    "print_json",
    "print_table",
    "stages",
    "typed_command",
]

MotionsOption = Annotated[
    str,
    typer.Option("--motions", "-m", help="`embedded`, `paper:DIR`, `npz:FILE` or another recording.", metavar="SPEC"),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder to write to; created if need be.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0)]


class Interrupted(BaseException):
    """A command was stopped; the message says where to go on. No ``KeyboardInterrupt``, which Typer would swallow.

    Attributes:
        signal: number of the signal that stopped it.
    """

    def __init__(self, where: str, number: int) -> None:
        super().__init__(where)
        self.signal = number


_REPEAT_SECONDS = 6.0  # longer than a pool needs to end deaf workers


@contextmanager
def interruptible(where: str | Callable[[], str]) -> Iterator[None]:
    """Turns Ctrl-C and a request to terminate inside the block into one line.

    An exception is lost where Python cannot raise it, in a callback or a destructor; so an interrupt that did not end
    the block is repeated.

    Args:
        where: what was kept and how to go on, or a function that says so once it is known.
    """
    stopped_by: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stopped_by.append(number)
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _REPEAT_SECONDS)
        raise KeyboardInterrupt

    names = [name for name in ("SIGINT", "SIGTERM", "SIGALRM") if hasattr(signal, name)]
    try:
        before = {name: signal.signal(getattr(signal, name), stop) for name in names}
    except ValueError:  # not the main thread, which alone may listen: somebody else decides there
        yield
        return
    try:
        yield
    except KeyboardInterrupt as interrupt:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        text = where if isinstance(where, str) else where()
        raise Interrupted(text, (stopped_by or [signal.SIGINT])[0]) from interrupt
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler or signal.SIG_DFL)


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


def typed_command() -> str:
    """The command line as the user wrote it."""
    import shlex

    return shlex.join(["syda-gym", *sys.argv[1:]])
