"""One frame gives what a batch gives: live use and evaluation see the same mapping."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.mappings.coding.arm_coders import HumanArmCoder, RobotArmCoder
from syda_gym.motions.loading import load_motions


@pytest.mark.parametrize("name", ["adult", "kid", "left_only"])
@pytest.mark.parametrize("placed", [False, True])
def test_humans_are_encoded_alike(name: str, placed: bool) -> None:
    motions = load_motions("embedded")
    body, frames = motions.bodies[name], np.concatenate([clip.frames for clip in motions.clips(name)])[::97]
    assert isinstance(body, HumanSkeleton)
    for sides in (body.sides, body.sides[:1]):
        coder = HumanArmCoder.fit(body, frames, sides, placed)
        single = np.concatenate([coder.encode(frame[None]) for frame in frames])
        assert np.abs(coder.encode(frames) - single).max() < 1e-14


@pytest.mark.parametrize("name", ["pepper", "nao"])
def test_robots_are_decoded_alike(name: str) -> None:
    motions = load_motions("embedded")
    body, frames = motions.bodies[name], np.concatenate([clip.frames for clip in motions.clips(name)])[::97]
    assert isinstance(body, Robot)
    for sides in (body.sides, body.sides[:1]):
        coder = RobotArmCoder.fit(body, frames, sides)
        codes = coder.encode(frames)
        codes[3, :, :3] = 0.0  # a model that knows nothing
        single = np.concatenate([coder.decode(code[None]) for code in codes])
        batch = coder.decode(codes)
        assert not body.violations(single, 0.0).any()
        assert np.abs(body.landmarks(single) - body.landmarks(batch)).max() < 1e-6
