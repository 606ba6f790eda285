"""SydaTeleopVectorEnv: many robots in one world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.face import Face
from syda_gym.envs.family import MAX_STEPS, warn_if_cut
from syda_gym.envs.fleet import EpisodeWish, Fleet
from syda_gym.envs.rendering import Painter
from syda_gym.envs.spaces import action_from_command, action_space, one_info, wishes
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import OptionError, SydaError, nearest_name
from syda_gym.simulation.pictures.camera import CameraView, Picture

__all__ = ["AUTORESET_MODES", "SydaTeleopVectorEnv"]

AUTORESET_MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}

_ANY = EpisodeWish()

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]
Result = tuple[Observations, Any, Any, Any, dict[str, Any]]


class SydaTeleopVectorEnv(Face, VectorEnv[Observations, NDArray[np.float32], Flags]):
    """``num_envs`` robots that share one world: sixteen per PyBullet client, or all in the arrays of the servo model.

    Robot ``i`` goes through the same trajectory, bit for bit, as a ``SydaTeleopEnv`` that was seeded with
    ``seed + i``. Options, observations, actions, rewards and the entries of ``info`` (stacked over the robots) are
    those of ``SydaTeleopEnv``; with ``start="failures"`` the robots share what they learn about where the policy fails.

    Args:
        num_envs: number of robots.
        render_mode: ``None`` or ``"rgb_array"``; ``render`` gives one picture per robot.
        autoreset_mode: ``next_step`` (Gymnasium's default: the step after the end of an episode resets the robot and
            ignores its action), ``same_step`` (the last observation is in ``infos["final_obs"]``), or ``disabled``
            (call ``reset(options={"reset_mask": mask})``).
        max_episode_steps: cuts episodes off (``truncated``) after so many steps, as ``gymnasium.make`` does by a
            wrapper; ``is_success`` then judges the steps until there. -1 is no limit.
        workers: processes that share the robots; the same bits as in one, and a million robots' steps in less time
            where cores are idle. They are spawned, so a script must do its work under ``if __name__ == "__main__":``.
        options: options, ``None`` for the defaults.
        **changes: single options, as in ``SydaTeleopEnv``.

    Raises:
        OptionError: a value outside what is allowed.
    """

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        *,
        autoreset_mode: str | AutoresetMode = "next_step",
        max_episode_steps: int | None = None,
        workers: int = 1,
        options: TeleopOptions | None = None,
        **changes: Any,
    ) -> None:
        if not _is_whole(num_envs, 1):
            raise OptionError(f"num_envs must be a positive whole number, got {num_envs!r}")
        if render_mode not in (None, "rgb_array"):
            raise OptionError(f"render_mode={render_mode!r}: many robots render as None or 'rgb_array'")
        if not _is_whole(workers, 1) or workers > num_envs:
            raise OptionError(f"workers must be a whole number from 1 to num_envs ({num_envs}), got {workers!r}")
        if max_episode_steps == -1 and not isinstance(max_episode_steps, bool):
            max_episode_steps = None
        if max_episode_steps is not None and not _is_whole(max_episode_steps, 1):
            raise OptionError(f"max_episode_steps must be a positive whole number or None, got {max_episode_steps!r}")
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.options = TeleopOptions.of(options, changes)
        self.num_envs = int(num_envs)
        self.render_mode = render_mode
        self._fleet = _fleet(self.options, self.num_envs, max_episode_steps, int(workers))
        if max_episode_steps == MAX_STEPS:
            warn_if_cut(self._fleet.repertoire.longest)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": round(self._fleet.rates.control_hz),
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space = Box(self.layout.low, self.layout.high, dtype=np.float32)
        self.single_action_space = action_space(self.robot)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._painter = Painter(CameraView.resolve(self.options.camera))
        self._rngs: list[np.random.Generator] = []
        self._pending: Flags = np.zeros(self.num_envs, dtype=bool)
        self._everyone: Flags = np.ones(self.num_envs, dtype=bool)
        repertoire = self._fleet.repertoire
        self._motions = np.array([clip.name for clip in repertoire.clips], dtype=object)
        self._motion_actions = np.array([clip.action for clip in repertoire.clips], dtype=object)

    def action_from_command(self, commands: ArrayLike) -> FloatArray:
        """The actions whose commands come nearest to ``commands`` ``(num_envs, n)`` [rad], in either action mode."""
        array = np.asarray(commands, dtype=np.float64)
        return action_from_command(self.options, self.robot, array, self._fleet.base)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | Sequence[dict[str, Any] | None] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begins an episode for every robot, or for those of ``options["reset_mask"]``.

        Args:
            seed: robot ``i`` gets ``seed + i``, or ``seed[i]``; ``None`` goes on with the random numbers at hand.
            options: as in ``SydaTeleopEnv.reset``; ``motion`` and ``frame`` may hold one value per robot. Or a sequence
                with the options of every robot.

        Returns:
            Observations and infos of all robots; the masks ``_key`` in the infos mark those that were reset.

        Raises:
            OptionError: unknown options or values.
            RouteError: the route cannot be taken.
            SydaError: the environment is closed.
        """
        self._check_open("reset")
        mask, wish = self._wishes(options)
        self._seed(seed, mask)
        which = np.flatnonzero(mask).tolist()
        self._fleet.reset(which, [self._rngs[i] for i in which], [wish[i] for i in which])
        self._pending = self._pending & ~mask
        return self._fleet.observe(), self._infos(mask)

    def step(self, actions: NDArray[np.float32]) -> Result:
        """One control step of every robot.

        Args:
            actions: ``(num_envs, n)``.

        Raises:
            OptionError: wrong shape or values that are not finite.
            SydaError: not reset yet, or closed.
        """
        self._check_open("step")
        if not self._rngs:
            raise SydaError("step was called before reset; call reset first")
        fleet = self._fleet
        if self.autoreset_mode is AutoresetMode.DISABLED:
            if self._pending.any():
                raise SydaError("an episode has ended; call reset(options={'reset_mask': terminated | truncated})")
            fleet.step(actions)
            self._pending = fleet.done
            return self._result(fleet.observe(), self._infos())
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            return self._step_and_restart(actions)
        pending = self._pending
        fleet.step(actions, skip=pending)
        if pending.any():
            self._restart(pending, handed_out=False)
        self._pending = fleet.done
        return self._result(fleet.observe(), self._infos())

    def render(self) -> tuple[Picture, ...] | None:
        """One picture per robot, ``(height, width, 3)`` uint8 each; ``None`` without a render mode."""
        if self.render_mode is None:
            return None
        self._check_open("render")
        return tuple(self._painter.picture(self._fleet, index) for index in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Releases physics and camera; Gymnasium calls this for an object whose constructor raised, too."""
        if hasattr(self, "_painter"):
            self._released = True
            self._fleet.close()
            self._painter.close()

    def _step_and_restart(self, actions: NDArray[np.float32]) -> Result:
        fleet = self._fleet
        fleet.step(actions)
        done = fleet.done
        if not done.any():
            return self._result(fleet.observe(), self._infos())
        which = np.flatnonzero(done)
        result = (fleet.reward, fleet.terminated, fleet.truncated)
        last, names = fleet.observe(which), [fleet.names(index) for index in which.tolist()]
        info = fleet.info()
        final_info = [one_info(info, name, index) for name, index in zip(names, which.tolist(), strict=True)]
        self._restart(done)
        infos = self._infos()
        final_obs = np.full(self.num_envs, None, dtype=object)
        stacked: dict[str, Any] = {}
        for row, index in enumerate(which.tolist()):
            final_obs[index] = last[row]
            stacked = self._add_info(stacked, final_info[row], index)
        infos.update(final_obs=final_obs, _final_obs=done, final_info=stacked, _final_info=done)
        return (fleet.observe(), *result, infos)

    def _restart(self, mask: Flags, *, handed_out: bool = True) -> None:
        which = np.flatnonzero(mask).tolist()
        wish = [_ANY] * len(which)
        self._fleet.reset(which, [self._rngs[index] for index in which], wish, handed_out=handed_out)

    def _result(self, observations: Observations, infos: dict[str, Any]) -> Result:
        fleet = self._fleet
        return observations, fleet.reward, fleet.terminated, fleet.truncated, infos

    def _wishes(self, options: dict[str, Any] | Sequence[dict[str, Any] | None] | None) -> tuple[Flags, Any]:
        """Who is reset, and what is asked of each robot."""
        repertoire, count = self._fleet.repertoire, self.num_envs
        if options is None or isinstance(options, dict):
            given = dict(options or {})
            mask = _mask(given.pop("reset_mask", None), count)
            return mask, wishes(repertoire, given, count)
        each = list(options)
        if len(each) != count:
            raise OptionError(f"expected options of {count} robots, got {len(each)}")
        return self._everyone, [wishes(repertoire, one, 1)[0] for one in each]

    def _infos(self, mask: Flags | None = None) -> dict[str, Any]:
        """The fleet's info with texts looked up, and Gymnasium's mask ``_key`` beside each key."""
        infos = self._fleet.info()
        routes = self._fleet.repertoire.routes
        names = np.array([route.name for route in routes], dtype=object)
        trust = np.array([route.transferability for route in routes])
        infos["motion"] = self._motions[infos["motion"]]
        infos["motion_action"] = self._motion_actions[infos["motion_action"]]
        infos["transferability"] = trust[infos["transferability"]]
        infos["route"] = names[infos["route"]]
        everyone = self._everyone if mask is None else mask
        infos["reward_terms"].update({f"_{name}": everyone for name in list(infos["reward_terms"])})
        infos.update({f"_{key}": everyone for key in list(infos)})
        return infos

    def _seed(self, seed: int | Sequence[int | None] | None, mask: Flags) -> None:
        if seed is None or isinstance(seed, int | np.integer):
            seeds: list[int | None] = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise OptionError(f"expected {self.num_envs} seeds, got {len(seeds)}")
        if not self._rngs:
            self._rngs = [seeding.np_random(value)[0] for value in seeds]
            return
        for index, value in enumerate(seeds):
            if value is not None and mask[index]:
                self._rngs[index] = seeding.np_random(value)[0]


def _fleet(options: TeleopOptions, count: int, max_steps: int | None, workers: int) -> Fleet:
    if workers == 1:
        return Fleet(options, count, max_steps)
    from syda_gym.envs.parallel.fleet import ParallelFleet

    return ParallelFleet(options, count, max_steps, workers)


def _is_whole(value: Any, least: int) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and int(value) >= least


def _autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    if mode not in AUTORESET_MODES:
        raise OptionError(f"autoreset_mode={mode!r} is not allowed; {nearest_name(str(mode), AUTORESET_MODES)}")
    return AUTORESET_MODES[mode]


def _mask(value: Any, count: int) -> Flags:
    if value is None:
        return np.ones(count, dtype=bool)
    mask = np.asarray(value)
    if mask.shape != (count,) or mask.dtype != bool or not mask.any():
        raise OptionError(f"reset_mask must be {count} booleans, at least one of them true, got {value!r}")
    return mask
