"""Mapping chains as episodes of ``SydaTeleop-v0``: play them, and say in figures how good they were."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray, landmark_error
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import MappingError, OptionError

if TYPE_CHECKING:
    from syda_gym.agents.agent import Agent
    from syda_gym.envs.teleop import SydaTeleopEnv
    from syda_gym.mappings.mapping import Mapping

__all__ = [
    "FIGURES",
    "EpisodeFigures",
    "Recording",
    "figures_of",
    "figures_of_all",
    "latency",
    "make_env",
    "play",
    "play_all",
]

AgentMaker = Callable[["SydaTeleopEnv"], "Agent"]
"""Builds an agent for an environment."""


@dataclass(frozen=True)
class EpisodeFigures:
    """One episode in numbers; lower is better except for ``success`` and ``coverage``.

    Attributes:
        motion: name of the clip.
        action: its action.
        frames: steps of the episode.
        landmark_error: mean distance of the robot's landmarks from the recorded ones [m].
        landmarks: the same for each landmark [m].
        joint_error: mean absolute joint error [rad].
        joints: the same for each joint [rad].
        mapping_error: landmark error of the base command itself, without motors and agent [m].
        success: whether the mean landmark error stayed within the environment's ``success_error``.
        jitter: mean third difference of the landmarks [m/frame^3].
        speed_violations: share of joint samples whose command asks for more than the joint's speed limit.
        limit_violations: share of joint samples of the mapping that lay outside the joint limits before clipping.
        self_collisions: share of frames in which the robot touches itself.
        coverage: share of frames whose mapping error lies within the mapping's error bound; not a number without one.
        bound: mean error bound [m]; not a number without one.
        reward: sum of the rewards.
    """

    motion: str
    action: str
    frames: int
    landmark_error: float
    landmarks: tuple[float, ...]
    joint_error: float
    joints: tuple[float, ...]
    mapping_error: float
    success: bool
    jitter: float
    speed_violations: float
    limit_violations: float
    self_collisions: float
    coverage: float
    bound: float
    reward: float

    def to_dict(self) -> dict[str, Any]:
        """As a JSON-able dictionary."""
        return asdict(self)


FIGURES = (
    "landmark_error", "joint_error", "mapping_error", "success", "jitter", "speed_violations", "limit_violations",
    "self_collisions", "coverage", "bound", "reward",
)  # fmt: skip
"""The figures that are single numbers."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything that an episode showed, one row a step.

    Attributes:
        motion: name of the clip.
        action: its action.
        route: bodies of the chain.
        fps: steps per second.
        operator: operator frames that the mapping saw ``(N, F)``.
        base: base commands ``(N, n)`` [rad].
        command: commands that the motors got ``(N, n)`` [rad].
        q: joint angles ``(N, n)`` [rad].
        reference: joint angles of the recorded motion ``(N, n)`` [rad].
        landmark_error: ``(N, 2 * arms)`` [m].
        contacts: touching pairs of links ``(N,)``.
        jitter: ``(N,)`` [m/frame^3].
        reward: ``(N,)``.
        success: as the environment judged.
    """

    motion: str
    action: str
    route: tuple[str, ...]
    fps: float
    operator: FloatArray
    base: FloatArray
    command: FloatArray
    q: FloatArray
    reference: FloatArray
    landmark_error: FloatArray
    contacts: NDArray[np.int64]
    jitter: FloatArray
    reward: FloatArray
    success: bool

    def __len__(self) -> int:
        return len(self.q)


def make_env(mapping: Mapping, motions: Any, actions: Sequence[str] | None = None, **options: Any) -> SydaTeleopEnv:
    """An environment that plays one chain.

    Args:
        mapping: the chain; its ends are the operator and the robot.
        motions: what to replay.
        actions: only these actions; all if ``None``.
        **options: of ``SydaTeleopEnv``. Commands are joint angles (``action_mode="position"``) unless told otherwise.

    Raises:
        OptionError: the chain does not end in a robot.
    """
    from syda_gym.envs.teleop import SydaTeleopEnv

    if not isinstance(mapping.target, Robot):
        raise OptionError(
            f"the chain {' > '.join(mapping.route)} ends in a {mapping.target.kind}; episodes need a robot at its end"
        )
    settings: dict[str, Any] = {"action_mode": "position", **options}
    return SydaTeleopEnv(
        operator=mapping.source.name,
        robot=mapping.target.name,
        mapping=mapping,
        motions=motions,
        actions=actions,
        **settings,
    )


def play(env: SydaTeleopEnv, agent: Agent, motion: int | str, seed: int | None = None) -> Recording:
    """Plays one episode.

    Args:
        env: the environment.
        agent: made for it.
        motion: clip to replay, by index or name.
        seed: of the environment's disturbances and the agent.

    Returns:
        All of its steps.
    """
    observation, info = env.reset(seed=seed, options={"motion": motion})
    agent.reset(1, seed)
    shown = env.layout["operator"]
    seen: list[NDArray[np.float32]] = []
    base: list[FloatArray] = []
    steps: list[dict[str, Any]] = []
    rewards: list[float] = []
    done = False
    while not done:
        seen.append(observation[shown])
        base.append(info["base"])
        command = agent.act(observation[None])[0]
        action = env.action_from_command(command)
        observation, reward, terminated, truncated, info = env.step(action)  # type: ignore[arg-type]
        steps.append(info)
        rewards.append(float(reward))
        done = terminated or truncated
    return Recording(
        motion=str(info["motion"]),
        action=str(info["motion_action"]),
        route=tuple(str(info["route"]).split(">")),
        fps=env.control_hz,
        operator=np.array(seen, dtype=np.float64),
        base=np.array(base),
        command=_column(steps, "command"),
        q=_column(steps, "q"),
        reference=_column(steps, "reference"),
        landmark_error=_column(steps, "landmark_error"),
        contacts=_column(steps, "contacts").astype(np.int64),
        jitter=_column(steps, "jitter"),
        reward=np.array(rewards),
        success=bool(info["is_success"]),
    )


def play_all(env: SydaTeleopEnv, agent: Agent, seed: int = 0) -> Iterator[Recording]:
    """Plays every clip of an environment once, in order.

    Each clip has its own seed, so that an agent meets the same disturbances whatever was played before.
    """
    for index in range(len(env.clip_names)):
        yield play(env, agent, index, seed=_episode_seed(seed, index))


def figures_of(recording: Recording, robot: Robot, mapping: Mapping, capsules: Any = None) -> EpisodeFigures:
    """Sums an episode up; see ``figures_of_all``."""
    return figures_of_all([recording], robot, mapping, capsules)[0]


def figures_of_all(
    recordings: Sequence[Recording], robot: Robot, mapping: Mapping, capsules: Any = None
) -> list[EpisodeFigures]:
    """Sums episodes of one chain up; together, because the mapping is asked once for all their frames.

    Args:
        recordings: of the episodes.
        robot: who was driven.
        mapping: the chain that gave the base command.
        capsules: a ``simulation.capsules.CapsuleModel`` of the robot to count self-collisions by geometry, where the
            physics did not; ``None`` to count the contacts of the physics.
    """
    if not recordings:
        return []
    frames = np.concatenate([recording.operator for recording in recordings])
    cuts = np.cumsum([len(recording) for recording in recordings])[:-1]
    outside = np.split(robot.violations(mapping.raw(frames), tolerance=1e-6), cuts)
    bound = _bound(mapping, frames)
    bounds = [None] * len(recordings) if bound is None else np.split(bound, cuts)
    return [
        _figures(recording, robot, capsules, violated, width)
        for recording, violated, width in zip(recordings, outside, bounds, strict=True)
    ]


def _figures(
    recording: Recording, robot: Robot, capsules: Any, outside: NDArray[np.bool_], bound: FloatArray | None
) -> EpisodeFigures:
    q, reference = recording.q, recording.reference
    joints = np.abs(q - reference).mean(axis=0)
    landmarks = recording.landmark_error.mean(axis=0)
    mapped = landmark_error(robot, recording.base, reference).mean(axis=1)
    speeds = np.abs(np.diff(recording.command, axis=0)) * recording.fps
    touching = recording.contacts > 0 if capsules is None else np.asarray(capsules.clearance(q)) < 0.0
    return EpisodeFigures(
        motion=recording.motion,
        action=recording.action,
        frames=len(recording),
        landmark_error=float(landmarks.mean()),
        landmarks=tuple(landmarks.tolist()),
        joint_error=float(joints.mean()),
        joints=tuple(joints.tolist()),
        mapping_error=float(mapped.mean()),
        success=recording.success,
        jitter=float(recording.jitter[3:].mean()) if len(recording) > 3 else 0.0,
        speed_violations=float((speeds > robot.speed * (1.0 + 1e-6)).mean()) if len(speeds) else 0.0,
        limit_violations=float(outside.mean()),
        self_collisions=float(touching.mean()),
        coverage=float("nan") if bound is None else float((mapped <= bound).mean()),
        bound=float("nan") if bound is None else float(bound.mean()),
        reward=float(recording.reward.sum()),
    )


def latency(
    mapping: Mapping, agent: Agent | None, frames: FloatArray, observation: NDArray[np.float32] | None = None
) -> float:
    """Median time that one frame takes through the chain and the agent, frame by frame as in live use [s].

    Args:
        mapping: the chain.
        agent: reset for one robot; ``None`` for the chain alone.
        frames: operator frames to try, ``(N, F)``.
        observation: one observation for the agent.
    """
    times = []
    for frame in frames[:50]:
        start = time.perf_counter()
        mapping(frame)
        if agent is not None and observation is not None:
            agent.act(observation[None])
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def _bound(mapping: Mapping, frames: FloatArray) -> FloatArray | None:
    try:
        return mapping.error_bound(frames)
    except MappingError:  # fitted without a bound, for example on a single action
        return None


def _column(steps: list[dict[str, Any]], name: str) -> FloatArray:
    return np.array([step[name] for step in steps], dtype=np.float64)


def _episode_seed(seed: int, index: int) -> int:
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])
