"""The public function is a plain function, and the room is light to import."""

from __future__ import annotations

import subprocess
import sys
from types import FunctionType

import syda_gym
from syda_gym import routes
from syda_gym.routes.metric import transferability as measure


def test_the_public_name_is_the_function_itself() -> None:
    assert syda_gym.transferability is measure
    assert isinstance(syda_gym.transferability, FunctionType)


def test_the_room_offers_what_it_lists() -> None:
    for name in routes.__all__:
        assert callable(getattr(routes, name))


def test_importing_it_loads_nothing_heavy() -> None:
    code = (
        "import sys, syda_gym.routes; "
        "print([m for m in ('torch', 'pybullet', 'matplotlib', 'pinocchio', 'networkx', 'scipy') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
