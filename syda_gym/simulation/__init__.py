"""THE WORLD: robots that are commanded and move; the only room that knows PyBullet."""

from syda_gym.simulation.backend import Backend, MotorConditions
from syda_gym.simulation.making import make_world
from syda_gym.simulation.rates import Rates

__all__ = ["Backend", "MotorConditions", "Rates", "make_world"]
