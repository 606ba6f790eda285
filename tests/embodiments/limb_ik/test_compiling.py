"""What numba compiles on first use: an interrupt meanwhile is not lost, and leaves nothing half-made."""

from __future__ import annotations

import os
import signal

import numba
import pytest

from syda_gym.embodiments.limb_ik.compiling import compiled, first_call


class Slow:
    """A function that gets a signal while it is compiled."""

    done = False

    def __call__(self, number: int) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        self.done = True
        return number + 1


def test_an_interrupt_waits_until_the_function_is_compiled() -> None:
    function = Slow()
    with pytest.raises(KeyboardInterrupt):
        first_call(function, 1)
    assert function.done


def test_a_compiled_function_is_called_as_it_is() -> None:
    function = Slow()
    with pytest.raises(KeyboardInterrupt):
        first_call(function, 1)
    function.done = False
    with pytest.raises(KeyboardInterrupt):
        first_call(function, 1)
    assert not function.done


def test_without_compiling_for_a_debugger_a_function_stays_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    def doubled(number: int) -> int:
        return 2 * number

    assert compiled(doubled) is doubled
