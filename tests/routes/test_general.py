"""The general definition: any body, every term in [0, 1], noise told."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.arms import discover_robot
from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.parametric import FULL_RANGE, parametric_human
from syda_gym.errors import EmbodimentError
from syda_gym.routes.metric import transferability
from syda_gym.routes.paper import paper_human
from syda_gym.routes.workspace.store import WorkspaceStore

# The terms are called C, L and T as in the paper, which the linter takes for constants.
# ruff: noqa: SIM300

FAST = {"definition": "general", "samples": 2**13, "repeats": 2}

# source, target, C, T: the reference values at 2^20 samples and alpha = 1
REFERENCE = [
    ("adult", "kid", 0.982, 0.753),
    ("kid", "adult", 0.973, 0.973),
    ("adult", "pepper", 0.562, 0.306),
    ("kid", "pepper", 0.558, 0.396),
    ("pepper", "kid", 0.934, 0.934),
    ("pepper", "adult", 0.934, 0.934),
]


def body(name: str) -> Embodiment:
    return catalog.get("pepper") if name == "pepper" else paper_human(name)


@pytest.mark.parametrize(("source", "target", "c", "t"), REFERENCE)
def test_reference_values(source: str, target: str, c: float, t: float) -> None:
    result = transferability(body(source), body(target), definition="general")
    assert result.C == pytest.approx(c, abs=0.01)
    assert result.T == pytest.approx(t, abs=0.01)
    assert result.spread < 0.005


@pytest.mark.parametrize("name", ["adult", "pepper", "nao", "stiff"])
def test_a_body_against_itself(name: str) -> None:
    result = transferability(name, name, definition="general")
    assert result.C == result.T == result.S == result.coverage == 1.0
    assert 1.0 - result.noise_floor >= 0.97  # against an independent resample


def test_scaled_copies_differ_in_length_alone() -> None:
    down, up = transferability("tall", "child", **FAST), transferability("child", "tall", **FAST)
    assert down.C == up.C == 1.0
    assert down.T == pytest.approx(catalog.get("child").reach / catalog.get("tall").reach)
    assert up.T == 1.0


def test_less_mobility_is_less_transferability_and_directional() -> None:
    values = [transferability("adult", parametric_human(f"m{m}", mobility=m / 10), **FAST) for m in (10, 8, 6, 4)]
    assert [v.C for v in values] == sorted((v.C for v in values), reverse=True)
    back = transferability(parametric_human("m4", mobility=0.4), "adult", **FAST)
    assert back.C > values[-1].C + 0.2


def test_same_seed_same_bits() -> None:
    first = transferability("adult", "pepper", seed=4, store=WorkspaceStore(), **FAST)
    again = transferability("adult", "pepper", seed=4, store=WorkspaceStore(), **FAST)
    other = transferability("adult", "pepper", seed=40, store=WorkspaceStore(), **FAST)
    assert first == again
    assert first.T != other.T


def test_ties_are_declared_within_the_noise() -> None:
    near = (
        transferability("pepper", paper_human("adult"), definition="general"),
        transferability("pepper", paper_human("kid"), definition="general"),
    )
    assert near[0].ties(near[1])
    assert not near[0].ties(transferability("adult", "pepper", definition="general"))


def test_one_armed_bodies_are_compared_by_their_arm() -> None:
    result = transferability("adult", "left_only", **FAST)
    assert "only the left arm" in result.notes[0]
    right_only = parametric_human("right_only", sides=("right",))
    crossed = transferability("left_only", right_only, **FAST)
    assert "mirrored right arm" in crossed.notes[0]
    assert crossed.C == 1.0


def test_alpha_scales() -> None:
    full, half = transferability("kid", "nao", **FAST), transferability("kid", "nao", alpha=0.5, **FAST)
    assert half.T == pytest.approx(0.5 * full.T)
    assert half.C == full.C


def _urdf(folder: Path, seed: int, joints: int, planar: bool) -> Path:
    rng = np.random.default_rng(seed)
    text, parent = '<robot name="r"><link name="base"/>', "base"
    for i in range(joints):
        axis = np.array([0.0, 0.0, 1.0]) if planar else rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        xyz = rng.normal(scale=0.2, size=3) * [1.0, 1.0, 0.0 if planar else 1.0] * (i > 0)
        low = rng.uniform(-3.0, 0.0)
        text += (
            f'<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            f'<limit lower="{low}" upper="{low + rng.uniform(0.2, 3.0)}" velocity="1" effort="1"/></joint>'
            f'<link name="l{i}"/>'
        )
        parent = f"l{i}"
    text += (
        f'<joint name="end" type="fixed"><parent link="{parent}"/><child link="tool"/>'
        '<origin xyz="0.2 0.05 0"/></joint><link name="tool"/></robot>'
    )
    path = folder / f"r{seed}.urdf"
    path.write_text(text)
    return path


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), joints=st.integers(2, 7), planar=st.booleans())
def test_all_terms_lie_between_0_and_1_for_random_arms(seed: int, joints: int, planar: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        robot = discover_robot(_urdf(Path(folder), seed, joints, planar))
        for a, b in ((robot, catalog.get("adult")), (catalog.get("pepper"), robot), (robot, robot)):
            result = transferability(a, b, samples=2**12, repeats=2, definition="general")
            for term in ("S", "D", "L", "alpha", "C", "coverage", "T", "noise_floor"):
                assert 0.0 <= getattr(result, term) <= 1.0, term
            assert result.C == pytest.approx(result.S + (1 - result.S) * (1 - result.D))
            assert pytest.approx(result.alpha * result.L * result.C) == result.T
        assert result.C == 1.0


@settings(deadline=None, max_examples=10)
@given(upper=st.floats(0.1, 0.5), fore=st.floats(0.1, 0.5), low=st.floats(-3.0, -0.1), span=st.floats(0.2, 3.0))
def test_any_human_is_comparable(upper: float, fore: float, low: float, span: float) -> None:
    human = HumanSkeleton(
        "any", height=1.7, upper_arm=upper, forearm=fore, shoulders=0.3, joint_limits={"t4": (low, low + span)}
    )
    result = transferability(human, "pepper", samples=2**12, repeats=2, definition="general")
    assert 0.0 < result.T <= 1.0


def test_a_planar_arm_gives_a_clear_answer(tmp_path: Path) -> None:
    planar = discover_robot(_urdf(tmp_path, 3, 3, planar=True))
    follow, lead = transferability("adult", planar, **FAST), transferability(planar, "adult", **FAST)
    for result in (follow, lead):
        assert any("planar" in note and "2 largest singular values" in note for note in result.notes)
    assert 0.0 < follow.coverage < 0.25
    assert any("reaches only" in note for note in follow.notes)
    assert lead.C > follow.C > 0.0


def test_joint_limits_that_do_not_rise_are_refused() -> None:
    human = HumanSkeleton("odd", height=1.7, upper_arm=0.3, forearm=0.3, shoulders=0.3, joint_limits={"t1": (1.0, 1.0)})
    with pytest.raises(EmbodimentError, match="rise from lower to upper"):
        transferability(human, "adult", definition="general")
    assert set(FULL_RANGE) == {"t1", "t2", "t3", "t4"}


def test_unknown_bodies_are_refused() -> None:
    with pytest.raises(EmbodimentError, match="unknown embodiment 'ghost'"):
        transferability("ghost", "adult", definition="general")


def test_the_result_is_json_able() -> None:
    import json

    text = json.dumps(transferability("adult", "kid", **FAST).as_dict())
    assert json.loads(text)["source"] == "adult"
