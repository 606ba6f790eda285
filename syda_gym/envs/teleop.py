"""SydaTeleopEnv: teleoperation of a humanoid as a Gymnasium environment."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.face import Face
from syda_gym.envs.options import TeleopOptions
from syda_gym.envs.rendering import Painter
from syda_gym.envs.solo import Solo
from syda_gym.envs.spaces import action_from_command, action_space, wishes
from syda_gym.errors import OptionError, SydaError
from syda_gym.simulation.camera import CameraView, Picture
from syda_gym.simulation.window import has_display

__all__ = ["SydaTeleopEnv"]

Observation = NDArray[np.float32]
Action = NDArray[np.float32]


class SydaTeleopEnv(Face, gymnasium.Env[Observation, Action]):
    """Replays an operator's motion on a robot; an agent corrects what the mapping asks for."""

    _fleet: Solo
    metadata = {"render_modes": ["human", "rgb_array", "rgb_array_list"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        options: TeleopOptions | None = None,
        **changes: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise OptionError(
                f"render_mode={render_mode!r} is not allowed; choose one of {self.metadata['render_modes']}"
            )
        self.options = TeleopOptions.of(options, changes)
        self.render_mode = render_mode
        self._fleet = Solo(self.options)
        self.metadata = {
            # Without a display, 'human' is not offered, so that tools which try every mode leave it alone.
            "render_modes": [mode for mode in type(self).metadata["render_modes"] if mode != "human" or has_display()],
            "render_fps": round(self._fleet.rates.control_hz),
        }
        self.observation_space = Box(self.layout.low, self.layout.high, dtype=np.float32)
        self.action_space = action_space(self.robot, self.options)
        self._started = False
        self._painter = Painter(CameraView.resolve(self.options.camera))
        self._pictures: list[Picture] = []

    def action_from_command(self, command: ArrayLike) -> FloatArray:
        """The action whose command comes nearest to ``command``, in either action mode.

        Args:
            command: joint angles ``(n,)`` [rad].

        Returns:
            ``(n,)``, within the action space.
        """
        return action_from_command(
            self.options, self.robot, np.asarray(command, dtype=np.float64), self._fleet.present_base
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: new seed of the environment's random numbers; ``None`` goes on with them.
            options: ``motion`` (name or index of a clip), ``frame`` (first frame), ``route`` (names of bodies).

        Raises:
            OptionError: unknown options or values.
            RouteError: the route cannot be taken.
        """
        super().reset(seed=seed)
        wish = wishes(self._fleet.repertoire, options, 1)
        observation, info = self._fleet.begin(self.np_random, wish[0])
        self._started = True
        if self.render_mode in ("human", "rgb_array_list"):
            self._pictures.clear()
            self._draw()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """One control step.

        Args:
            action: ``(n,)`` corrections in [-1, 1] or joint angles [rad].

        Raises:
            OptionError: wrong shape or values that are not finite.
            SydaError: not reset yet.
        """
        if not self._started:
            raise SydaError("step was called before reset; call reset first")
        result = self._fleet.play(action)
        if self.render_mode in ("human", "rgb_array_list"):
            self._draw()
        return result

    def render(self) -> Any:
        """What the render mode asks for.

        Returns:
            ``rgb_array``: a picture ``(height, width, 3)`` uint8. ``rgb_array_list``: the pictures since the last call
            or reset. ``human``: nothing; the window is kept up to date by ``reset`` and ``step``.

        Raises:
            SydaError: not reset yet.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() does nothing without a render mode; make the environment with render_mode='rgb_array'"
            )
            return None
        if not self._started:
            raise SydaError("render was called before reset; call reset first")
        if self.render_mode == "rgb_array_list":
            pictures, self._pictures = self._pictures, []
            return pictures
        return self._painter.picture(self._fleet) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Releases physics, camera and window; harmless when repeated."""
        self._fleet.close()
        self._painter.close()

    def _draw(self) -> None:
        if self.render_mode == "human":
            self._painter.show(self._fleet)
        else:
            self._pictures.append(self._painter.picture(self._fleet))
