"""A cheap environment: two bodies' motions from the generator, closed-form retargeting as the mapping."""

from __future__ import annotations

from dataclasses import replace

import pytest

from syda_gym.motions.synthetic.generator import generate


@pytest.fixture(scope="session")
def motions():
    return generate(("adult", "kid", "pepper", "nao"), seed=4, actions=("wave_high", "reach_high_front"), variants=2)


@pytest.fixture(scope="session")
def cheap(motions):
    return {"motions": motions, "mapping": "geometric", "preset": "fixed", "route": ("adult", "pepper")}


@pytest.fixture(scope="session")
def hasty(cheap):
    """The same, eight times as fast: more than any motor can follow."""
    takes = tuple(
        replace(take, frames={body: frames[::8] for body, frames in take.frames.items()}, filled={})
        for take in cheap["motions"].takes
    )
    return {**cheap, "motions": replace(cheap["motions"], takes=takes)}
