"""Options that belong together: a dataclass whose fields become options of every command that takes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from inspect import Parameter, signature
from typing import Any, get_type_hints

__all__ = ["with_group"]


def with_group(name: str, group: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a command that takes ``name`` the fields of ``group`` as options in its place.

    Args:
        name: of the command's keyword.
        group: a dataclass whose fields are annotated as options and have defaults.
    """
    hints = get_type_hints(group, include_extras=True)
    # A group that stands on another one shows its own options first.
    members = sorted(fields(group), key=lambda field: field.name not in group.__annotations__)
    options = [
        Parameter(field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name])
        for field in members
    ]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = signature(command, eval_str=True)

        @wraps(command)
        def run(**given: Any) -> None:
            command(**{name: group(**{field.name: given.pop(field.name) for field in members})}, **given)

        kept = [parameter for key, parameter in own.parameters.items() if key != name]
        parameters = [*(parameter.replace(kind=Parameter.KEYWORD_ONLY) for parameter in kept), *options]
        # Typer reads both.
        run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return decorate
