"""Tuned settings of the classical rivals for each cell of disturbances, as ``scripts/study_agents.py`` found them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from syda_gym.agents.agent import Agent
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.interface import Interface
from syda_gym.envs.task.disturbances import Disturbances
from syda_gym.files import asset, read_json

__all__ = ["cell_of", "tuned_rival", "tuned_settings"]

_LATE = ("latency", "latency_jitter", "loss")
_WEAK = ("motor_gain", "motor_speed", "payload", "friction")


def cell_of(disturbances: Any) -> str:
    """The cell of the suite ``teleop`` that disturbances are most like.

    Args:
        disturbances: as the environment's option of that name takes them; ``None`` is ``lag``, where there is
            nothing but the motors' own lag.

    Raises:
        OptionError: unknown disturbances.
    """
    given = Disturbances.resolve(disturbances)
    if given is None:
        return "lag"
    nothing = Disturbances()
    late = any(getattr(given, name) != getattr(nothing, name) for name in _LATE)
    weak = any(getattr(given, name) != getattr(nothing, name) for name in _WEAK)
    if given.watches_landmarks and late:
        return "full" if weak else "noise+latency"
    return "noise" if given.watches_landmarks else "latency" if late else "lag"


def tuned_settings(name: str, disturbances: Any = None) -> dict[str, float]:
    """Settings of a rival that were best on training motions under such disturbances; none where it has none.

    Args:
        name: of ``RIVALS``.
        disturbances: see ``cell_of``.
    """
    return dict(_shipped().get(cell_of(disturbances), {}).get(name, {}))


def tuned_rival(name: str, interface: Interface, disturbances: Any = None) -> Agent:
    """A rival with ``tuned_settings``.

    Raises:
        AgentError: unknown rival.
    """
    return make_rival(name, interface, **tuned_settings(name, disturbances))


@lru_cache(maxsize=1)
def _shipped() -> dict[str, dict[str, dict[str, float]]]:
    cells: dict[str, dict[str, dict[str, float]]] = read_json(asset("agents", "tuned", "settings.json"))["cells"]
    return cells
