"""Old spellings of options: they work for one version and say what is written now. Nothing else knows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from syda_gym.cli.names import CONFIGS, METHODS, PRESETS

__all__ = ["OLD_SPELLINGS", "Old", "Program", "rewritten"]


def _same(value: str) -> str:
    return value


def _always(value: str) -> bool:
    return True


@dataclass(frozen=True)
class Old:
    """One spelling that has changed.

    Attributes:
        command: whose, for example ``"motions pair"``.
        old: the option as it was, or an argument's name in capitals: a last argument that has become an option.
        new: the option as it is.
        when: which values are meant; others keep their meaning.
        value: from the old value to the new one.
    """

    command: str
    old: str
    new: str
    when: Callable[[str], bool] = _always
    value: Callable[[str], str] = _same


def _is_method(value: str) -> bool:
    return value.partition(":")[0] in METHODS and not Path(value).exists()


def _is_config(value: str) -> bool:
    """Whether ``--preset`` of ``train`` means its hyper-parameters, misspelt ones too, and no mapping's preset."""
    near = get_close_matches(value, [*CONFIGS, *PRESETS], n=1)
    return value in CONFIGS or bool(near and value not in PRESETS and near[0] in CONFIGS)


OLD_SPELLINGS: tuple[Old, ...] = (
    Old("route", "--from", "--operator"),
    Old("route", "--to", "--robot"),
    *(Old(command, "--mapping", "--method", _is_method) for command in ("train", "evaluate", "play", "teleop")),
    Old("train", "--preset", "--config", _is_config),
    Old("export-episodes", "--disturbance", "--disturbances"),
    Old("reproduce-paper", "--method", "--method", lambda value: "/" in value, lambda value: value.replace("/", ":")),
    Old("record", "--prompts", "--motions"),
    Old("record", "OUT", "--out"),
    Old("motions convert", "OUT", "--out"),
    Old("motions pair", "OUT", "--out"),
)
"""Everything that was written otherwise in 0.1."""


class Program(typer.Typer):
    """A ``typer.Typer`` whose commands understand old spellings."""

    def command(self, name: str | None = None, **options: Any) -> Callable[[Any], Any]:
        """As ``typer.Typer.command``."""
        options.setdefault("cls", _Command)
        return super().command(name, **options)


class _Command(TyperCommand):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Rewrites old spellings, then parses."""
        olds = [old for old in OLD_SPELLINGS if old.command == _path(ctx)]
        if olds:
            words, changes = rewritten(olds, args)
            for old in olds:
                if not old.old.startswith("-"):
                    words, change = self._argument(ctx, old, words)
                    changes += change
            for before, after in dict.fromkeys(changes):
                typer.echo(
                    f"warning: write {after} instead of {before}, which the next version will not know", err=True
                )
            args = words
        return super().parse_args(ctx, args)

    def _argument(self, ctx: Any, old: Old, words: list[str]) -> tuple[list[str], list[tuple[str, str]]]:
        """A superfluous last argument becomes the option that replaced it."""
        _, rest, _ = self.make_parser(ctx).parse_args(list(words))
        if len(rest) != 1 or old.new in words:
            return words, []
        place = len(words) - 1 - words[::-1].index(rest[0])
        return [*words[:place], old.new, *words[place:]], [(f"the argument {old.old}", f"{old.new} {rest[0]}")]


def rewritten(olds: Sequence[Old], words: Sequence[str]) -> tuple[list[str], list[tuple[str, str]]]:
    """Command line words with old options replaced.

    Args:
        olds: spellings that have changed.
        words: as the user typed them.

    Returns:
        The words as they are written now, and what changed: before and after.
    """
    result: list[str] = []
    changes: list[tuple[str, str]] = []
    left = list(words)
    while left:
        word = left.pop(0)
        if word == "--":
            return [*result, word, *left], changes
        name, equals, value = word.partition("=")
        found = next((old for old in olds if old.old == name), None)
        if found is None or not (equals or left):
            result.append(word)
            continue
        if not equals:
            value = left.pop(0)
        if not found.when(value):
            result += [word] if equals else [word, value]
            continue
        result += [found.new, found.value(value)]
        changed = found.value(value) != value
        said = (f"{name} {value}", f"{found.new} {found.value(value)}") if changed else (name, found.new)
        changes.append(said)
    return result, changes


def _path(ctx: Any) -> str:
    """The command's words without the program's name."""
    words = []
    while ctx.parent is not None:
        words.append(ctx.info_name)
        ctx = ctx.parent
    return " ".join(reversed(words))
