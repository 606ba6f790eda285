"""Scene: what an exported episode is played in, said in plain words that a data set can keep."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.evaluation.benchmark.config import split_method

__all__ = ["Exported", "Scene", "episode_seeds"]


@dataclass(frozen=True)
class Exported:
    """What was stored: number of episodes and steps, and the folder."""

    episodes: int
    steps: int
    path: Path


@dataclass(frozen=True)
class Scene:
    """Who moves whom, by what, and who acts.

    Attributes:
        motions: what ``load_motions`` takes.
        route: chain, written ``adult>kid>pepper``.
        method: mapping method, with a preset behind a colon.
        agent: ``base`` or a classical rival.
        disturbance: ``none`` or a preset.
        seed: of the episodes.
        command: the command line, for the data set's description.
        options: further options of ``SydaTeleop-v0``.
    """

    motions: str = "embedded"
    route: str = "adult>pepper"
    method: str = "syda"
    agent: str = "base"
    disturbance: str = "none"
    seed: int = 0
    command: str = ""
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Bodies of the chain."""
        return tuple(part.strip() for part in self.route.split(">"))

    def environment(self) -> dict[str, Any]:
        """Options of ``SydaTeleop-v0``.

        Raises:
            OptionError: an unknown method or preset.
        """
        kind, preset = split_method(self.method)
        return {
            "operator": self.bodies[0],
            "robot": self.bodies[-1],
            "route": self.bodies,
            "mapping": kind,
            "preset": preset,
            "motions": self.motions,
            "disturbances": None if self.disturbance == "none" else self.disturbance,
            **self.options,
        }

    def words(self) -> str:
        """One line about it, for a data set's description."""
        return (
            f"{self.route} on {self.motions}, disturbance {self.disturbance}, seed {self.seed}. {self.command}".strip()
        )

    def requirements(self) -> list[str]:
        """What it takes to play it again, as pip writes it."""
        return [f"syda-gym; python_version=='{platform.python_version()}'"]


def episode_seeds(seed: int, clips: int, count: int) -> Iterator[tuple[int, int]]:
    """Clip and seed of each episode: clip after clip, each episode with a seed of its own.

    Args:
        seed: of all.
        clips: how many there are.
        count: of episodes; 0 for one a clip.
    """
    for index in range(count or clips):
        yield index % clips, int(np.random.SeedSequence([seed, index]).generate_state(1)[0])
