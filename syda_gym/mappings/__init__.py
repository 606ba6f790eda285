"""HOW motion crosses from one body to another."""

from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.fitting.fit import METHODS, fit, fit_many
from syda_gym.mappings.limits import SpeedLimiter
from syda_gym.mappings.mapping import Mapping
from syda_gym.mappings.storage import load_mapping, save_mapping

__all__ = [
    "METHODS",
    "ChainMapping",
    "Mapping",
    "SpeedLimiter",
    "fit",
    "fit_many",
    "load_mapping",
    "save_mapping",
]
