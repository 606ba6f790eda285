"""Unknown dynamics: how motors, payload and friction change while an episode runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from syda_gym.envs.task.disturbances import Disturbances, Drawn
from syda_gym.simulation.motor_plan import MotorPlan

__all__ = ["motor_plan"]

_GROUPS = (("motor_gain", "motor_speed"), ("payload",), ("friction",))
"""What changes together: motors that get weak lose gain and speed, a payload is taken up or put down."""


def motor_plan(disturbed: Disturbances, drawn: Drawn, steps: int, dt: float) -> MotorPlan:
    """The motors of one episode.

    Moments of change are a Poisson process of ``drawn.changes`` a second. At each of them one of three is drawn anew
    from its range, the others stay: the motors (gain and speed), the payload, or the friction. All of it follows from
    the draws of the episode alone, so that neither the length nor what else is disturbed alters an earlier change.

    Args:
        disturbed: ranges.
        drawn: disturbances that the episode begins with.
        steps: control steps that the episode has at most.
        dt: control step [s].
    """
    if drawn.changes <= 0.0:
        return MotorPlan((drawn.motors,))
    rng = np.random.default_rng(drawn.seed_of_changes)
    conditions, at, now, time = [drawn.motors], [0], drawn, 0.0
    while True:
        time += rng.exponential(1.0 / drawn.changes)
        step = int(np.ceil(time / dt))
        group = _GROUPS[int(rng.integers(len(_GROUPS)))]
        shares = rng.random(2)
        if step >= steps:
            return MotorPlan(tuple(conditions), tuple(at))
        fresh: dict[str, Any] = {n: disturbed.at_share(n, s) for n, s in zip(group, shares.tolist(), strict=False)}
        now = replace(now, **fresh)
        if step == at[-1]:
            conditions[-1] = now.motors
        else:
            conditions.append(now.motors)
            at.append(step)
