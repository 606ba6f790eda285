"""Recording: the episodes that an environment would play, written down as streams without playing them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.interface import Interface
from syda_gym.agents.streams.streams import Streams
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.task.disturbances import Drawn, deliver, freeze_elbow_yaw, see, warm_up
from syda_gym.envs.task.dynamics import motor_plan
from syda_gym.envs.task.observation import MAX_AGE, teleop_layout
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.repertoire import Repertoire
from syda_gym.errors import AgentError

__all__ = ["Ground"]

_CHUNK = 64  # episodes mapped at once: large enough to be fast, small enough for the cache


class Ground:
    """What agents are tuned and trained on: an environment's motions, mapping and disturbances, without its physics.

    Args:
        options: of the environment; the first planned route is taken.

    Attributes:
        repertoire: clips and base commands.
        interface: of the environment.
    """

    def __init__(self, options: TeleopOptions | Mapping[str, Any]) -> None:
        self.options = options if isinstance(options, TeleopOptions) else TeleopOptions(**options)
        self.repertoire = Repertoire(self.options)
        self.rates = self.options.rates
        seen = {"preview": self.options.preview, "history": self.options.history}
        layout = teleop_layout(self.repertoire.operator, self.repertoire.robot, **seen)
        self.interface = Interface(
            self.repertoire.robot, dict(layout), layout.size, self.rates.dt, self.rates.lag_share
        )

    @property
    def clips(self) -> int:
        """Number of clips."""
        return len(self.repertoire.clips)

    def parts(self) -> dict[str, list[int]]:
        """Clips to train on and clips to choose by, of different actions: every fifth action is for ``validation``.

        Where there is only one action, both are all clips.
        """
        actions = sorted({clip.action for clip in self.repertoire.clips})
        kept = set(actions[2::5] or actions[-1:]) if len(actions) > 1 else set()
        numbered = list(enumerate(clip.action for clip in self.repertoire.clips))
        return {
            "train": [index for index, action in numbered if action not in kept],
            "validation": [index for index, action in numbered if action in kept or not kept],
        }

    def record_part(self, part: str, episodes: int, *, seed: int) -> Streams:
        """Episodes of one of the ``parts``, spread over all of its clips."""
        clips = self.parts()[part]
        spread = np.linspace(0, len(clips) - 1, min(episodes, len(clips))).round().astype(int)
        return self.record(episodes, clips=[clips[index] for index in spread], seed=seed)

    def record(
        self,
        episodes: int | None = None,
        *,
        clips: Sequence[int] | None = None,
        disturbances: Any = "of the options",
        seed: int = 0,
    ) -> Streams:
        """Episodes one after the other through the clips, each with disturbances of its own.

        Args:
            episodes: how many; one per clip by default.
            clips: indices of the clips to go through; all by default.
            disturbances: other ones than the options say.
            seed: episode ``i`` is what an environment plays that is reset with the generator of ``[seed, i]``.

        Returns:
            Streams whose length is that of the longest clip plus one, for the observation after the end.
        """
        from syda_gym.envs.task.disturbances import Disturbances

        chosen = list(range(self.clips)) if clips is None else [int(clip) for clip in clips]
        count = len(chosen) if episodes is None else episodes
        if not chosen or count < 1:
            raise AgentError("nothing to record: give at least one clip and one episode")
        given = self.options.disturbances if disturbances == "of the options" else disturbances
        disturbed = Disturbances.resolve(given)
        plays = [chosen[i % len(chosen)] for i in range(count)]
        rngs = [np.random.default_rng([seed, i]) for i in range(count)]
        for rng in rngs:
            rng.random(3)  # clip, frame and route, which are decided here
        drawn = [disturbed.draw(rng) if disturbed is not None else None for rng in rngs]
        parts = [
            part
            for at in range(0, count, _CHUNK)
            for part in self._chunk(plays[at : at + _CHUNK], rngs[at : at + _CHUNK], drawn[at : at + _CHUNK])
        ]
        base, age, reference, operator, ahead = (np.stack([part[i] for part in parts]) for i in range(5))
        return Streams(
            self.repertoire.limited(base),
            age,
            reference,
            np.array([self.repertoire.clips[clip].length for clip in plays], dtype=np.int64),
            tuple(
                motor_plan(disturbed, values, self.repertoire.clips[clip].length, self.rates.dt)
                for clip, values in zip(plays, drawn, strict=True)
                if disturbed is not None and values is not None
            ),
            tuple(self.repertoire.clips[clip].name for clip in plays),
            operator,
            ahead.reshape(*base.shape[:2], -1, base.shape[2]) if self.options.preview else None,
        )

    def _chunk(
        self, plays: list[int], rngs: list[np.random.Generator], drawn: list[Drawn | None]
    ) -> list[tuple[FloatArray, ...]]:
        """Base, age, reference, operator and preview of some episodes."""
        seen, newest, firsts = [], [], []
        for clip, rng, values in zip(plays, rngs, drawn, strict=True):
            frames, packets, first = self._watch(clip, rng, values)
            seen.append(frames)
            newest.append(packets)
            firsts.append(first)
        mapped = [self.repertoire.map(0, frames) for frames in seen]
        return [
            self._episode(clip, values, frames, base, packets, first)
            for clip, values, frames, base, packets, first in zip(
                plays, drawn, seen, mapped, newest, firsts, strict=True
            )
        ]

    def _watch(
        self, clip: int, rng: np.random.Generator, drawn: Drawn | None
    ) -> tuple[FloatArray, NDArray[np.intp], int]:
        """Operator frames as seen, the newest packet at each step, and the number of the first packet."""
        entry, rows = self.repertoire.clips[clip], self.repertoire.operator_rows
        if drawn is None:
            packets = np.arange(entry.length + 1)
            return rows[entry.first + packets], packets, 0
        first = -warm_up(drawn, self.rates.dt)
        packets = np.arange(first, entry.length + 1)
        frames = rows[entry.first + np.clip(packets, 0, entry.length)]
        frames = see(drawn, self.repertoire.operator, frames, rng)
        return frames, deliver(drawn, first, entry.length, 0, self.rates.dt, rng), first

    def _episode(
        self,
        clip: int,
        drawn: Drawn | None,
        seen: FloatArray,
        base: FloatArray,
        newest: NDArray[np.intp],
        first: int,
    ) -> tuple[FloatArray, ...]:
        robot, entry, n = self.repertoire.robot, self.repertoire.clips[clip], self.interface.n
        freeze = 0.0 if drawn is None else drawn.freeze_elbow_yaw
        target = self.repertoire.target_rows(freeze)[entry.rows, :n]
        age = np.zeros(entry.length + 1)
        if drawn is not None:
            base = freeze_elbow_yaw(robot, base, freeze)
            age = np.minimum((np.arange(entry.length + 1) - newest) * self.rates.dt, MAX_AGE)
        pad = self.repertoire.longest - entry.length

        def padded(array: FloatArray) -> FloatArray:
            return np.concatenate([array, np.repeat(array[-1:], pad, axis=0)])

        at = newest - first
        ahead = self.repertoire.base_with_preview(base, at, self.options.preview)[:, n:]
        return padded(base[at]), padded(age), padded(target), padded(seen[at]), padded(ahead)
