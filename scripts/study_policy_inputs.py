"""What a residual policy could see beyond what it sees: how much of the remaining error each input would explain.

    python scripts/study_policy_inputs.py --study study --cell full --out docs/results/agents-inputs.json

The predictor of the cell is played on training and validation motions. A ridge regression then explains what it leaves,
joint by joint, from what a policy sees and from further inputs: what explains nothing here, on motions that it was not
fitted to, gives a policy nothing to learn. The test motions are not looked at.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from study_agents import CELLS, Study

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent
from syda_gym.agents.learned.views import Views
from syda_gym.agents.streams.streams import Streams, play_streams, read_stream
from syda_gym.files import write_json

Array = NDArray[np.float64]
PAST = 4  # steps of the history that is tried
RIDGE = 50.0
INPUTS = {
    "what a policy sees": (),
    "and the packet age times each input": ("age",),
    "and a history of 4 steps": ("history",),
    "and the mapping's difficulty, alone and times each input": ("difficulty",),
    "and the operator's frame": ("operator",),
    "all of these but the operator": ("age", "history", "difficulty"),
}


def samples(study: Study, agent: Agent, streams: Streams) -> dict[str, Array]:
    """One row an arm and step: the features of ``Views``, further inputs, and the joint error that is left."""
    interface, robot, half = study.interface, study.interface.robot, study.interface.n // 2
    views = Views(interface, True)
    q = play_streams(agent, streams, study.rates)
    before = np.concatenate([streams.base[:, :1], q[:, :-1]], axis=1)
    speed = np.diff(before, axis=1, prepend=before[:, :1]) / interface.dt
    assert streams.operator is not None
    flat = streams.operator.reshape(-1, streams.operator.shape[-1])
    difficulty = study.mapping.difficulty(flat).reshape(streams.age.shape)
    agent.reset(len(streams))
    rows: dict[str, list[Any]] = {name: [] for name in ("seen", "history", "difficulty", "operator", "left")}
    for t in range(q.shape[1]):
        reading = read_stream(interface, streams, t, before[:, t], speed[:, t])
        command = agent.act_on(reading)
        rows["seen"].append(views.see(command, np.zeros_like(command), reading)[:, : -interface.n])
        past = [array[:, max(t - k, 0)] - before[:, t] for k in range(1, PAST + 1) for array in (streams.base, before)]
        rows["history"].append(_both(np.concatenate(past, axis=1), np.concatenate([robot.mirror(p) for p in past], 1)))
        rows["difficulty"].append(_both(difficulty[:, t, None]))
        rows["operator"].append(_both(streams.operator[:, t]))
        error = streams.reference[:, t] - q[:, t]
        rows["left"].append(_both(error[:, :half], robot.mirror(error)[:, :half]))
    mask = _both(streams.mask).T
    return {name: np.stack(found)[mask] for name, found in rows.items()}


def _both(left: Any, right: Any = None) -> NDArray[Any]:
    """Rows of left arms, then of right arms; the same for both if only one is given."""
    return np.concatenate([left, left if right is None else right])


def columns(found: dict[str, Array], inputs: tuple[str, ...], age: int) -> Array:
    """The inputs of a regression."""
    seen = found["seen"]
    parts = [seen]
    if "age" in inputs:
        parts += [seen[:, age : age + 1] * seen]
    if "difficulty" in inputs:
        parts += [found["difficulty"], found["difficulty"] * seen]
    parts += [found[name] for name in ("history", "operator") if name in inputs]
    return np.concatenate(parts, axis=1)


def explained(train: Array, train_left: Array, other: Array, other_left: Array) -> tuple[float, float]:
    """Share of the squared error that a ridge regression explains, where it was fitted and elsewhere."""
    mean, spread = train.mean(axis=0), train.std(axis=0) + 1e-6

    def scaled(x: Array) -> Array:
        return np.concatenate([np.clip((x - mean) / spread, -8.0, 8.0), np.ones((len(x), 1))], axis=1)

    x = scaled(train)
    weights = np.linalg.solve(x.T @ x + RIDGE * np.eye(x.shape[1]), x.T @ train_left)

    def share(inputs: Array, left: Array) -> float:
        return float(1.0 - np.square(left - inputs @ weights).sum() / np.square(left).sum())

    return share(x, train_left), share(scaled(other), other_left)


def main() -> None:
    """Prints one row for each set of inputs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", type=Path, default=Path("study"))
    parser.add_argument("--cell", choices=CELLS, default="full")
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    study = Study(given.study)
    agent = load_agent(study.folder(given.cell) / "predictor-0", study.interface)
    train = samples(study, agent, study.streams("train", given.cell, 320, 2000))
    other = samples(study, agent, study.streams("validation", given.cell, 120, 77))
    age = 3 * study.interface.n
    rows = {}
    print("| inputs | training motions | validation motions |\n|---|---|---|")
    for name, inputs in INPUTS.items():
        shares = explained(columns(train, inputs, age), train["left"], columns(other, inputs, age), other["left"])
        rows[name] = {"train": shares[0], "validation": shares[1]}
        print(f"| {name} | {shares[0]:.3f} | {shares[1]:.3f} |", flush=True)
    if given.out is not None:
        write_json(given.out, {"cell": given.cell, "inputs": rows})


if __name__ == "__main__":
    main()
