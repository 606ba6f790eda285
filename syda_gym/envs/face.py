"""Face: what the single and the vectorised environment tell about themselves in the same words."""

from __future__ import annotations

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.robot import Robot
from syda_gym.envs.fleet import Fleet
from syda_gym.envs.task.observation import ObservationLayout
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import SydaError
from syda_gym.simulation.rates import Rates

__all__ = ["Face"]


class Face:
    """Read-only facts about an environment.

    Attributes:
        options: the options that the environment was made with.
    """

    options: TeleopOptions
    _fleet: Fleet
    _released = False

    def _check_open(self, what: str) -> None:
        """Refuses to go on after ``close``.

        Raises:
            SydaError: the environment is closed.
        """
        if self._released:
            raise SydaError(f"{what} was called after close, which released the physics; make a new environment")

    @property
    def layout(self) -> ObservationLayout:
        """Which number of the observation means what."""
        return self._fleet.layout

    @property
    def operator(self) -> Embodiment:
        """Who leads."""
        return self._fleet.repertoire.operator

    @property
    def robot(self) -> Robot:
        """Who follows."""
        return self._fleet.robot

    @property
    def rates(self) -> Rates:
        """Control and physics rate, motor gain and lag."""
        return self._fleet.rates

    @property
    def control_hz(self) -> float:
        """Steps per second."""
        return self._fleet.rates.control_hz

    @property
    def dt(self) -> float:
        """Time of one step [s]."""
        return self._fleet.rates.dt

    @property
    def substeps(self) -> int:
        """Physics steps per control step."""
        return self._fleet.rates.substeps

    @property
    def motor_gain(self) -> float:
        """Share of the position error that a motor removes per physics step."""
        return self._fleet.rates.motor_gain

    @property
    def clip_names(self) -> tuple[str, ...]:
        """Names of the clips, for ``reset(options={"motion": name})``."""
        return tuple(self._fleet.repertoire.names)

    @property
    def clip_actions(self) -> tuple[str, ...]:
        """What is done in each clip."""
        return tuple(clip.action for clip in self._fleet.repertoire.clips)

    @property
    def routes(self) -> tuple[tuple[str, ...], ...]:
        """The routes that episodes may take, best first."""
        return tuple(route.bodies for route in self._fleet.repertoire.routes)
