"""The route for the clip that is about to be played: the dry run knows its own motion.

All clips are rehearsed together, beside the shipped motions, every clip as an action of its own: the links that carry
it have not seen it. Another route than the fixed one is taken where its advantage on this very clip exceeds the
standard error of the advantage over all actions; a smaller one is a tie, and ties are no reason to change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.errors import EmbodimentError, OptionError, RouteError
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import Plan, limb_directions
from syda_gym.routes.dry_run.rehearsal import Rehearsal

__all__ = ["routes_for_clips"]


def routes_for_clips(
    bodies: Mapping[str, Embodiment],
    routes: Sequence[Sequence[str]],
    clips: Sequence[FloatArray],
    fps: float,
    *,
    seed: int = 0,
) -> list[int]:
    """Chooses a route for every clip.

    Args:
        bodies: name to body, all that the routes pass; two-armed operators only.
        routes: candidates between the same ends, the fixed choice first.
        clips: frames of the operator, ``(N, F)`` each.
        fps: of the clips.
        seed: of folds and noise.

    Returns:
        Index of a route per clip.

    Raises:
        OptionError: no route.
        MotionError: an operator without two arms, or a clip that is too short to be planned.
    """
    if not routes:
        raise OptionError("routes_for_clips needs at least one route")
    if len(routes) == 1:
        return [0] * len(clips)
    operator = bodies[routes[0][0]]
    names = [f"to be played {place}" for place in range(len(clips))]
    planned = Plan(tuple(limb_directions(operator, clip, fps) for clip in clips), tuple(names))
    together = Rehearsal(bodies, default_plan() + planned, seed=seed)
    fixed, *others = routes
    errors = together.error(fixed)
    chosen, gains = [0] * len(clips), np.zeros(len(clips))
    for index, route in enumerate(others, start=1):
        try:
            advantage = errors - together.error(route)
            _, noise = together.margin(route, fixed)
        except (EmbodimentError, RouteError):
            continue  # cannot be judged, so it is no reason to change
        for place, name in enumerate(names):
            gain = float(advantage[together.actions == name].mean())
            if gain > max(noise, gains[place]):
                chosen[place], gains[place] = index, gain
    return chosen
