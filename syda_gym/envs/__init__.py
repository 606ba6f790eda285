"""The Gymnasium face of the house: teleoperation episodes, single and vectorised."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from syda_gym.envs.task.options import TeleopOptions as TeleopOptions
    from syda_gym.envs.teleop import SydaTeleopEnv as SydaTeleopEnv
    from syda_gym.envs.vector import SydaTeleopVectorEnv as SydaTeleopVectorEnv

_LAZY = {"TeleopOptions": "task.options", "SydaTeleopEnv": "teleop", "SydaTeleopVectorEnv": "vector"}

__all__ = ["SydaTeleopEnv", "SydaTeleopVectorEnv", "TeleopOptions"]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
