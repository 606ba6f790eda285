"""How all commands speak: the console, tables, progress, JSON; knows no command."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

__all__ = [
    "Interrupted",
    "bar",
    "console",
    "counted",
    "interruptible",
    "print_json",
    "print_table",
    "say_written",
    "show_table",
    "stages",
    "typed_command",
]


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


def show_table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", note: str = "") -> None:
    """Prints a small table, every character as it is: ``[mm]`` is a unit and no markup.

    Args:
        headings: of the columns, with units.
        rows: cells, as many as headings.
        title: above it.
        note: below it, what a reader needs to understand a column.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title) if title else None)
    for heading in headings:
        table.add_column(Text(heading), overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    say = console()
    say.print(table)
    if note:
        say.print(Text(note, style="dim"), soft_wrap=True)


def say_written(what: str, path: str | Path, remark: str = "") -> None:
    """Says what was written where, as one line that can be copied."""
    from rich.text import Text

    line = Text.assemble(f"{what}: ", (str(path), "bold"), f" {remark}" if remark else "")
    console().print(line, soft_wrap=True)


@contextmanager
def bar(words: str) -> Iterator[Callable[[float], None]]:
    """One progress bar; yields a function that is told the finished fraction."""
    from rich.progress import Progress

    with Progress(console=console(stderr=True)) as progress:
        task = progress.add_task(words, total=1.0)
        yield lambda share: progress.update(task, completed=share)


@contextmanager
def counted() -> Iterator[tuple[Callable[[int, int, str], None], Callable[[float, str], None]]]:
    """A progress bar over cells that moves within them, too.

    Yields:
        A function that is told how many of how many and the last one's name, and one that is told how much of the
        running ones is done and the name of one.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), TextColumn("{task.fields[cells]}"), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=console(stderr=True)) as shown:
        task = shown.add_task("", total=None, cells="")
        finished = 0

        def progress(done: int, count: int, name: str) -> None:
            nonlocal finished
            finished = done
            shown.update(task, completed=done, total=count, description=name, cells=f"{done}/{count}")

        yield progress, lambda part, name: shown.update(task, completed=finished + part, description=name)


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
