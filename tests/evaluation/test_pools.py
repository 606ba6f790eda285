"""Pools: every job once, lost workers are failures, nobody outlives whoever closed or lost the pool."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from syda_gym.errors import OptionError
from syda_gym.evaluation.pools import InlinePool, make_pool, run_jobs
from tests.evaluation.pool_jobs import broken, opened

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX knows them")


def is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_every_job_is_computed_once_in_processes_of_one_thread():
    jobs = [("add", float(value)) for value in range(7)]
    found = list(run_jobs(make_pool(2, opened, 10), jobs))
    assert sorted(job[1] for job, _ in found) == [job[1] for job in jobs]
    assert all(done.result["sum"] == job[1] + 10 and done.failure == "" for job, done in found)
    assert {done.result["threads"] for _, done in found} == {"1"}
    processes = {done.result["process"] for _, done in found}
    assert 1 <= len(processes) <= 2
    assert os.getpid() not in processes
    assert not any(map(is_running, processes))
    assert [done.result["sum"] for _, done in run_jobs(InlinePool(opened, 10), jobs)] == [10.0 + v for v in range(7)]


def test_a_killed_worker_is_a_failed_job_and_the_rest_goes_on():
    jobs = [("die", signal.SIGKILL), ("add", 1.0), ("exit", 7.0), ("unsendable", 0.0), ("nonsense", 0.0), ("add", 2.0)]
    found = {job: done for job, done in run_jobs(make_pool(1, opened, 0), jobs)}
    assert "SIGKILL" in found["die", signal.SIGKILL].failure
    assert "exit code 7" in found["exit", 7.0].failure
    assert "pickle" in found["unsendable", 0.0].failure.lower()
    assert "ValueError: no such job: nonsense" in found["nonsense", 0.0].failure
    assert [found["add", value].result["sum"] for value in (1.0, 2.0)] == [1.0, 2.0]
    lost = list(run_jobs(make_pool(1, broken), [("add", 1.0)]))
    assert "RuntimeError: cannot open" in lost[0][1].failure


def test_progress_is_told_from_inside_a_job():
    told: list[float] = []
    list(run_jobs(make_pool(1, opened, 0), [("sleep", 3.0)], inside=lambda running: told.append(running[0][1])))
    assert told == sorted(told)
    assert len(set(told)) >= 3
    assert 0.0 < told[-1] < 1.0


def test_a_closed_pool_leaves_nobody_even_if_a_worker_is_deaf():
    pool = make_pool(2, opened, 0)
    processes = [member.process.pid for member in pool._members]
    jobs = run_jobs(pool, [("deaf", 0.0), ("sleep", 60.0)], inside=heard)
    with pytest.raises(KeyboardInterrupt):
        next(jobs)
    assert not any(map(is_running, processes))


def heard(running: dict[int, tuple[object, float]]) -> None:
    if any(fraction == 0.5 for _, fraction in running.values()):
        raise KeyboardInterrupt


CALLER = """
from syda_gym.evaluation.pools import make_pool, run_jobs
from tests.evaluation.pool_jobs import opened
if __name__ == "__main__":
    pool = make_pool(2, opened, 0)
    print(*[member.process.pid for member in pool._members], flush=True)
    for _ in run_jobs(pool, [("sleep", 100.0)] * 2, inside=lambda running: print("told", flush=True)):
        pass
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("busy", [False, True], ids=["while workers start", "while they work"])
def test_nobody_outlives_a_caller_that_is_stopped(how, busy):
    caller = subprocess.Popen(
        [sys.executable, "-c", CALLER],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert caller.stdout is not None
    processes = [int(word) for word in caller.stdout.readline().split()]
    if busy:
        while caller.stdout.readline() != "told\n":
            pass
        time.sleep(0.5)
    # As a terminal does it: Ctrl-C reaches the workers, too.
    (os.killpg if how == signal.SIGINT else os.kill)(caller.pid, how)
    _, said = caller.communicate(timeout=60.0)
    deadline = time.monotonic() + 60.0
    while any(map(is_running, processes)):
        assert time.monotonic() < deadline, "workers were left behind"
        time.sleep(0.05)
    assert said.count("Traceback") == (1 if how == signal.SIGINT else 0)  # of the caller, none of a worker


def test_unknown_pools_are_refused():
    for workers in ("0", "2000", "many", -1):
        with pytest.raises(OptionError, match="workers must be a number"):
            make_pool(workers, opened, 0)
