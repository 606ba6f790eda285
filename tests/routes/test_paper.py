"""The paper's definition reproduces its Tables 2 and 5."""

# The terms are called S, D, L, C, T as in the paper, which the linter takes for constants.
# ruff: noqa: SIM300

from __future__ import annotations

import pytest

from syda_gym.embodiments import catalog
from syda_gym.embodiments.parametric import parametric_human
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.routes import best_route
from syda_gym.routes.metric import transferability

# source, target, S, KL, 1 - D, alpha, T: Table 2 of the paper to more digits, and the two pairs behind Table 5
TABLE = [
    ("adult", "kid", 0.326531, 0.005600, 0.4986, 1.0, 0.508025),
    ("kid", "adult", 0.212885, 0.073245, 0.4817, 1.0, 0.454119),
    ("adult", "pepper", 0.112178, 0.592378, 0.3561, 1.0, 0.235752),
    ("pepper", "adult", 0.321869, 2.772109, 0.0589, 1.0, 0.199125),
    ("kid", "pepper", 0.111645, 0.591065, 0.3564, 0.76, 0.233548),
    ("pepper", "kid", 0.326153, 2.740149, 0.0606, 0.76, 0.200157),
]


@pytest.mark.parametrize(("source", "target", "s", "kl", "capability", "alpha", "t"), TABLE)
def test_table_2(source: str, target: str, s: float, kl: float, capability: float, alpha: float, t: float) -> None:
    result = transferability(source, target, definition="paper")
    assert result.S == pytest.approx(s, abs=1e-3)
    assert result.KL == pytest.approx(kl, abs=1e-2)
    assert 1.0 - result.D == pytest.approx(capability, abs=5e-4)
    assert result.alpha == alpha
    assert result.T == pytest.approx(t, abs=5e-4)


@pytest.mark.parametrize(("via", "source", "t"), [("kid", "adult", 0.1186), ("adult", "kid", 0.1071)])
def test_table_5(via: str, source: str, t: float) -> None:
    route = best_route(source, "pepper", fitted=[("adult", "kid"), (via, "pepper")], definition="paper")
    assert route.bodies == (source, via, "pepper")
    assert route.T == pytest.approx(t, abs=5e-4)


def test_other_lengths_change_the_answer_and_nao_counts_as_built_like_pepper() -> None:
    assert 0.0 < transferability("adult", "nao", definition="paper").T < 0.3
    long = parametric_human("long", upper_share=0.6)
    assert transferability(long, "pepper", "paper").T != transferability("adult", "pepper", "paper").T


def test_a_body_against_itself_is_told_to_be_meaningless() -> None:
    result = transferability("adult", "adult", "paper")
    assert result.T == pytest.approx(0.5)
    assert "no meaning" in result.notes[0]


def test_an_arm_that_is_not_like_peppers_is_refused() -> None:
    import dataclasses

    pepper = catalog.get("pepper")
    arms = tuple(
        dataclasses.replace(arm, joints=arm.joints[:4], wrist=arm.tip)
        for arm in pepper.description.arms  # type: ignore[attr-defined]
    )
    robot = type(pepper)(dataclasses.replace(pepper.description, arms=arms, name="four"))  # type: ignore[attr-defined,call-arg]
    with pytest.raises(EmbodimentError, match="definition='general'"):
        transferability("adult", robot, "paper")


def test_bad_options() -> None:
    with pytest.raises(OptionError, match="did you mean 'paper'"):
        transferability("adult", "kid", definition="papr")  # type: ignore[arg-type]
    with pytest.raises(OptionError, match="alpha"):
        transferability("adult", "kid", "general", alpha=1.5)
    with pytest.raises(OptionError, match="power of two"):
        transferability("adult", "kid", "general", samples=1000)
    with pytest.raises(OptionError, match="cell"):
        transferability("adult", "kid", "general", cell=2.0)
    with pytest.raises(OptionError, match="takes no 'samples'"):
        transferability("adult", "kid", samples=1000)
