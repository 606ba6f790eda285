"""JSON and YAML of strangers: measured before they are built."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

from syda_gym.errors import StorageError, SydaError
from syda_gym.files.budget import BUDGET, read_bytes

__all__ = ["parse_json", "read_json", "read_yaml"]

_LONG_NUMBER = re.compile(rb"\d{%d}" % (BUDGET.digits + 1))
_MARKS = (b"[", b"{", b",", b":")


def read_json(path: str | os.PathLike[str], limit: int = 64 * 2**20) -> Any:
    """Reads a JSON file of at most ``limit`` bytes.

    Raises:
        StorageError: the file is missing, larger than ``limit``, or not JSON; or it holds more values than the budget
            of readers allows, or numbers of very many digits.
    """
    source = Path(path)
    if not source.is_file():
        raise StorageError(f"no file {source}; check the path")
    if source.stat().st_size > limit:
        raise StorageError(f"{source} is larger than {limit} bytes; expected a small JSON file")
    return parse_json(read_bytes(source, limit, "a JSON file"), str(source), hint="write it again")


def parse_json(data: bytes, where: str, error: type[SydaError] = StorageError, hint: str = "") -> Any:
    """JSON from bytes, within the budget.

    Args:
        data: UTF-8 text.
        where: file, for messages.
        error: exception to raise.
        hint: what to do about damaged JSON.

    Raises:
        SydaError: of the kind ``error``.
    """
    nodes = sum(data.count(mark) for mark in _MARKS)
    if nodes > BUDGET.nodes:
        raise error(f"{where} holds more than {BUDGET.nodes} values; cut it into pieces")
    if _LONG_NUMBER.search(data):
        raise error(f"{where} is not valid JSON for this library: a number has more than {BUDGET.digits} digits")
    try:
        return json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as problem:
        reason = "it is nested too deeply" if isinstance(problem, RecursionError) else str(problem)
        raise error(f"{where} is not valid JSON: {reason}{hint and '; ' + hint}") from problem


def read_yaml(
    path: str | os.PathLike[str],
    what: str,
    error: type[SydaError] = StorageError,
    limit: int = BUDGET.settings,
) -> Any:
    """Reads a hand-written YAML file.

    Aliases are counted as if they were written out, so that ten lines cannot become a thousand million values.

    Args:
        path: the file.
        what: what it should be, for messages.
        error: exception to raise.
        limit: bytes.

    Raises:
        SydaError: of the kind ``error``: missing, too large, not YAML, too many values or levels.
    """
    import yaml

    data = read_bytes(path, limit, what, error)
    if _LONG_NUMBER.search(data):
        raise error(f"{path}: a number has more than {BUDGET.digits} digits; expected {what}")
    # Not the C loader: its composer calls itself once a level, and deep nesting ends the whole process.
    try:
        text = data.decode("utf-8-sig")
        _check_events(text, str(path), what, error)
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, TypeError, RecursionError, OverflowError, AttributeError) as problem:
        if isinstance(problem, SydaError):
            raise
        reason = " ".join(str(problem).split())[:300]
        raise error(f"{path} is not valid YAML: {reason}") from problem


def _check_events(text: str, path: str, what: str, error: type[SydaError]) -> None:
    """Counts what the document becomes with every alias written out."""
    import yaml

    written: dict[str, int] = {}
    stack: list[tuple[str | None, int]] = []  # anchor of each open collection and its values so far
    total = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        grown = 1
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in written:
                raise error(f"{path}: alias *{event.anchor} stands inside its own anchor or has none; expected {what}")
            grown = written[event.anchor]
        elif isinstance(event, yaml.CollectionStartEvent):
            stack.append((event.anchor, 0))
            if len(stack) > BUDGET.depth:
                raise error(f"{path} is nested more than {BUDGET.depth} levels deep; expected {what}")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, count = stack.pop()
            grown = count + 1
            total -= count
            if anchor is not None:
                written[anchor] = grown
        elif isinstance(event, yaml.ScalarEvent):
            if event.anchor is not None:
                written[event.anchor] = 1
        else:
            continue
        if not isinstance(event, yaml.CollectionStartEvent):
            total += grown
            if stack:
                anchor, count = stack[-1]
                stack[-1] = (anchor, count + grown)
        if total > BUDGET.described:
            raise error(f"{path} becomes more than {BUDGET.described} values with its aliases; expected {what}")
