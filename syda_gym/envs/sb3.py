"""SB3: the vectorised environment as a Stable-Baselines3 ``VecEnv``, without a copy in between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from syda_gym.envs.spaces import one_info
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.errors import OptionError

__all__ = ["TeleopVecEnv"]


class TeleopVecEnv(VecEnv):  # type: ignore[misc]
    """Adapter of ``SydaTeleopVectorEnv`` for SB3's algorithms.

    Episodes restart within the step, as SB3 expects: ``infos[i]["terminal_observation"]`` holds the last observation,
    ``infos[i]["TimeLimit.truncated"]`` says that the clip ended, and ``infos[i]["episode"]`` has return and length, so
    that no ``Monitor`` is needed. The other entries of ``info`` come at the end of an episode, because dicts for
    hundreds of robots cost more than the physics.

    Args:
        env: made with ``autoreset_mode="same_step"``.

    Raises:
        OptionError: another autoreset mode.
    """

    def __init__(self, env: SydaTeleopVectorEnv) -> None:
        if env.metadata["autoreset_mode"].name != "SAME_STEP":
            raise OptionError(
                "SB3 restarts episodes within the step; make the environment with autoreset_mode='same_step'"
            )
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: NDArray[Any] = np.zeros((env.num_envs, 0))
        self._returns = np.zeros(self.num_envs)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)

    def reset(self) -> NDArray[np.float32]:
        """Begins an episode for every robot; seeds and options given by ``seed`` and ``set_options`` are used once.

        Options are of one robot each, or the same for all, as SB3 has it.

        Raises:
            SydaError: unknown options, or the environment is closed.
        """
        seeds = [None if seed is None else int(seed) for seed in self._seeds]
        observations, _ = self.env.reset(seed=seeds, options=[dict(options) for options in self._options])
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._steps[:] = 0
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keeps the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], list[dict[str, Any]]]:
        """One control step."""
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        self._returns += rewards
        self._steps += 1
        done = terminated | truncated
        result: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(done).tolist():
            result[index] = {
                **_final(infos["final_info"], index),
                "terminal_observation": infos["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
                "episode": {"r": float(self._returns[index]), "l": int(self._steps[index]), "t": 0.0},
            }
        self._returns[done] = 0.0
        self._steps[done] = 0
        return observations, rewards, done, result

    def close(self) -> None:
        """Closes the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute, once per robot; all share it."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute of the shared environment."""
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calls a method of the shared environment once and gives its result for each robot."""
        result = getattr(self.env, method_name)(*args, **kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Never wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[Any]:
        """One picture per robot."""
        return self.env.render() or []


def _final(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """One robot's last info out of the stacked ones."""
    columns = {key: value for key, value in infos.items() if not key.startswith("_") and not isinstance(value, dict)}
    return one_info(columns, {}, index)
