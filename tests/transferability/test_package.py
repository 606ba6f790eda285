"""The package is callable and light to import."""

from __future__ import annotations

import subprocess
import sys

import pytest

import syda_gym
from syda_gym.transferability.metric import transferability as measure


def test_both_spellings_of_the_documentation_work() -> None:
    assert syda_gym.transferability("adult", "kid", "paper") == measure("adult", "kid", "paper")
    assert syda_gym.transferability.transferability is measure
    for name in syda_gym.transferability.__all__:
        assert callable(getattr(syda_gym.transferability, name))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = syda_gym.transferability.nothing


def test_importing_it_loads_nothing_heavy() -> None:
    code = (
        "import sys, syda_gym.transferability; "
        "print([m for m in ('torch', 'pybullet', 'matplotlib', 'pinocchio', 'networkx', 'scipy') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
