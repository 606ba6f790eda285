"""Measuring distances between two steps of the loop saves time and changes no bit."""

from __future__ import annotations

import numpy as np

from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import LoopSettings, Tick
from tests.teleoperation.conftest import LimbMapping


def test_settling_changes_no_bit(mapping: LimbMapping, adult: HumanSkeleton, pepper: Robot) -> None:
    settings = LoopSettings(calibration=0.0, cutoff=0.0)
    loops, rng, held = [TeleoperationLoop(mapping, settings) for _ in range(2)], np.random.default_rng(2), 0
    for index in range(200):
        if index % 4 == 0:
            mapping.fixed = pepper.clamp(rng.uniform(pepper.lower, pepper.upper))[0]
        settled, plain = (loop.step(Tick(index / 30, adult.standing())) for loop in loops)
        loops[0].settle()
        assert settled.command.tobytes() == plain.command.tobytes()
        assert settled.reasons == plain.reasons
        held += "self-collision: held back" in plain.reasons
    assert held > 5, "some of these poses do touch"
