"""Streams: base commands over time, as an environment would show them, kept to tune and teach agents fast.

What the operator does, and what noise, latency and packet loss make of it, does not depend on the robot. So the base
command, its packet's age and the reference of an episode can be recorded once and then played with any agent in the
servo model without the environment around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.figures import Figures, figures_of_points, mean_figures
from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError
from syda_gym.simulation.capsules import CapsuleModel
from syda_gym.simulation.making import make_world
from syda_gym.simulation.motor_plan import MotorPlan, changing_steps
from syda_gym.simulation.rates import Rates

__all__ = ["Past", "Streams", "join", "play_streams", "score_streams"]


@dataclass(frozen=True, eq=False)
class Streams:
    """``E`` episodes of up to ``T`` control steps.

    Attributes:
        base: base command ``(E, T, n)`` [rad]; after the end of an episode its last command is repeated.
        age: of the packet ``(E, T)`` [s].
        reference: where the joints should be after the step ``(E, T, n)`` [rad].
        lengths: control steps of each episode ``(E,)``.
        motors: how each robot differs from the nominal one, and when that changes; nominal if empty.
        names: of each episode, for tables.
        operator: newest operator frame at hand ``(E, T, F)``; only needed where an agent reads whole observations.
        ahead: base commands of the ``k`` steps to come ``(E, T, k, n)`` [rad]; only where a preview is shown.
    """

    base: FloatArray
    age: FloatArray
    reference: FloatArray
    lengths: NDArray[np.int64]
    motors: tuple[MotorPlan, ...] = ()
    names: tuple[str, ...] = field(default=())
    operator: FloatArray | None = None
    ahead: FloatArray | None = None

    def __post_init__(self) -> None:
        episodes, steps = self.base.shape[:2]
        if self.reference.shape != self.base.shape or self.age.shape != (episodes, steps):
            raise AgentError(
                f"streams need base and reference (E, T, n) and age (E, T), got {self.base.shape}, "
                f"{self.reference.shape} and {self.age.shape}"
            )
        if self.lengths.shape != (episodes,) or (self.lengths < 4).any() or (self.lengths > steps).any():
            raise AgentError("streams need one length per episode, at least 4 and at most T")
        if self.motors and len(self.motors) != episodes:
            raise AgentError(f"{len(self.motors)} motor plans for {episodes} episodes; give one each or none")

    def __len__(self) -> int:
        return len(self.base)

    def rows(self, which: Sequence[int] | NDArray[np.intp]) -> Streams:
        """Some of the episodes."""
        index = np.asarray(which, dtype=np.intp)
        return Streams(
            self.base[index],
            self.age[index],
            self.reference[index],
            self.lengths[index],
            tuple(self.motors[i] for i in index) if self.motors else (),
            tuple(self.names[i] for i in index) if self.names else (),
            None if self.operator is None else self.operator[index],
            None if self.ahead is None else self.ahead[index],
        )

    @property
    def preview(self) -> FloatArray:
        """Base commands of every step and of those to come ``(E, T, k + 1, n)`` [rad]."""
        now = self.base[:, :, None]
        return now if self.ahead is None else np.concatenate([now, self.ahead], axis=2)

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which steps belong to their episode ``(E, T)``."""
        return np.arange(self.base.shape[1])[None] < self.lengths[:, None]

    @property
    def changing(self) -> NDArray[np.bool_]:
        """Steps in which a robot's motors or payload change, ``(E, T)``."""
        plans = self.motors or (MotorPlan(),) * len(self)
        return changing_steps(plans, self.base.shape[1])


def join(parts: Sequence[Streams]) -> Streams:
    """All episodes of several streams, padded to the longest by repeating the last step."""
    steps = max(part.base.shape[1] for part in parts)

    def padded(array: FloatArray | None) -> FloatArray:
        assert array is not None
        return np.concatenate([array, np.repeat(array[:, -1:], steps - array.shape[1], axis=1)], axis=1)

    with_motors = any(part.motors for part in parts)
    return Streams(
        np.concatenate([padded(part.base) for part in parts]),
        np.concatenate([padded(part.age) for part in parts]),
        np.concatenate([padded(part.reference) for part in parts]),
        np.concatenate([part.lengths for part in parts]),
        tuple(m for p in parts for m in (p.motors or (MotorPlan(),) * len(p))) if with_motors else (),
        tuple(name for part in parts for name in (part.names or ("",) * len(part))),
        None if any(p.operator is None for p in parts) else np.concatenate([padded(p.operator) for p in parts]),
        None if any(p.ahead is None for p in parts) else np.concatenate([padded(p.ahead) for p in parts]),
    )


def play_streams(agent: Agent, streams: Streams, rates: Rates) -> FloatArray:
    """Plays an agent in the servo model.

    Args:
        agent: who acts; it is reset first.
        streams: what it sees.
        rates: control and physics rate; must be those of the agent's interface.

    Returns:
        Joint angles after each step ``(E, T, n)`` [rad]. Robots begin at rest at their first base command.

    Raises:
        AgentError: the rates are not those that the agent is made for.
    """
    interface = agent.interface
    if abs(rates.dt - interface.dt) > 1e-9 or abs(rates.lag_share - interface.alpha) > 1e-9:
        raise AgentError(f"the agent is made for dt={interface.dt}, alpha={interface.alpha}; got {rates}")
    episodes, steps = streams.base.shape[:2]
    world = make_world(interface.robot, rates, count=episodes, physics="servo")
    for index, plan in enumerate(streams.motors):
        world.set_conditions(index, plan.first)
    changing = streams.changing
    world.reset(np.arange(episodes, dtype=np.intp), streams.base[:, 0])
    agent.reset(episodes)
    result = np.empty_like(streams.base)
    n = interface.n
    past = Past(interface, episodes)
    past.begin(np.arange(episodes), streams.base[:, 0])
    for t in range(steps):
        q = world.pose[:, :n]
        command = agent.act_on(read_stream(interface, streams, t, q, world.qd, past.rows))
        past.add(streams.base[:, t], q)
        for index in np.flatnonzero(changing[:, t]).tolist():
            world.set_conditions(index, streams.motors[index].at(t))
        world.advance(command)
        result[:, t] = world.pose[:, :n]
    world.close()
    return result


def read_stream(
    interface: Interface, streams: Streams, t: int, q: FloatArray, qd: FloatArray, past: FloatArray | None = None
) -> Reading:
    """The reading of step ``t`` of every episode, with the observation that the environment would show.

    Blocks that a stream does not hold (the previous action; a preview or histories that were not recorded) are zero.
    """
    rows = np.arange(len(streams))
    return read_rows(interface, streams, rows, np.full(len(rows), t), q, qd, past)


class Past:
    """The last base commands and joint angles of robots, as the environment keeps them for its histories.

    Attributes:
        rows: ``(B, 2, h, n)`` [rad]: base commands, then joint angles; the newest first. ``h`` may be 0.
    """

    def __init__(self, interface: Interface, count: int) -> None:
        block = interface.layout.get("base_history", slice(0, 0))
        self.rows = np.zeros((count, 2, (block.stop - block.start) // interface.n, interface.n))

    def begin(self, which: NDArray[np.intp], base: FloatArray) -> None:
        """Robots ``which`` begin an episode at rest at ``base`` ``(k, n)`` [rad]."""
        self.rows[which] = base[:, None, None]

    def add(self, base: FloatArray, q: FloatArray) -> None:
        """What was asked for and where the joints were before the step that is made now, ``(B, n)`` each."""
        if self.rows.shape[2]:
            self.rows = np.concatenate([np.stack([base, q], axis=1)[:, :, None], self.rows[:, :, :-1]], axis=2)


def read_rows(
    interface: Interface,
    streams: Streams,
    episodes: NDArray[np.integer[Any]],
    steps: NDArray[np.integer[Any]],
    q: FloatArray,
    qd: FloatArray,
    past: FloatArray | None = None,
) -> Reading:
    """The reading of step ``steps[i]`` of episode ``episodes[i]`` for robots ``i`` at ``q`` ``(B, n)``.

    ``past`` are the rows of ``Past``, where the layout has histories.
    """
    base, age = streams.base[episodes, steps], streams.age[episodes, steps]
    layout = interface.layout
    observation = np.zeros((len(q), interface.size))
    preview = base[:, None]
    if streams.ahead is not None:
        preview = np.concatenate([preview, streams.ahead[episodes, steps]], axis=1)
    error = layout["base_error"].start
    shown = (preview - q[:, None]).reshape(len(q), -1)
    observation[:, error : error + shown.shape[1]] = shown
    if past is not None and past.shape[2]:
        apart = (past - q[:, None, None]).reshape(len(q), 2, -1)
        observation[:, layout["base_history"]], observation[:, layout["q_history"]] = apart[:, 0], apart[:, 1]
    observation[:, layout["q"]], observation[:, layout["qd"]] = q, qd
    observation[:, layout["packet_age"].start] = age
    if streams.operator is not None and "operator" in layout:
        observation[:, layout["operator"]] = streams.operator[episodes, steps]
    return Reading(base=base, preview=preview, q=q, qd=qd, age=age, observation=observation)


def score_streams(
    agent: Agent, streams: Streams, rates: Rates, *, skip: int = 0, capsules: CapsuleModel | None = None
) -> Figures:
    """Mean figures of an agent over all episodes.

    Args:
        agent: who acts.
        streams: what it sees.
        rates: control and physics rate.
        skip: steps at the start of each episode that are left out.
        capsules: counts steps with a contact; none are counted if left out.
    """
    return mean_figures(stream_figures(agent, streams, rates, skip=skip, capsules=capsules))


def stream_figures(
    agent: Agent, streams: Streams, rates: Rates, *, skip: int = 0, capsules: CapsuleModel | None = None
) -> list[Figures]:
    """Figures of every episode."""
    q = play_streams(agent, streams, rates)
    robot = agent.interface.robot

    def touching(e: int, length: int) -> NDArray[np.bool_] | None:
        return None if capsules is None else capsules.clearance(q[e, skip:length]) < 0.0

    points, targets = _landmarks(robot, q), _landmarks(robot, streams.reference)
    return [
        figures_of_points(
            q[e, skip:length],
            streams.reference[e, skip:length],
            points[e, skip:length],
            targets[e, skip:length],
            touching(e, length),
        )
        for e, length in enumerate(streams.lengths.tolist())
    ]


def _landmarks(robot: Robot, q: FloatArray) -> FloatArray:
    """Landmarks ``(E, T, P, 3)`` of joint angles ``(E, T, n)``, all at once: a call costs more than its rows."""
    return robot.landmarks(q.reshape(-1, q.shape[-1])).reshape(*q.shape[:2], -1, 3)
