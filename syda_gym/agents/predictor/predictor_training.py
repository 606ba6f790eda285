"""Training of the predictor: regression through the servo, on recorded streams, in torch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.classical.projection import capsule_model
from syda_gym.agents.classical.rivals import Lead
from syda_gym.agents.figures import JOINT_WEIGHT, Figures
from syda_gym.agents.interface import Interface, Reading, lag_share
from syda_gym.agents.learned.predictor import Predictor, input_count, network_inputs
from syda_gym.agents.learned.tcn import TcnShape, receptive_field
from syda_gym.agents.predictor.contact_term import ContactTerm
from syda_gym.agents.streams.streams import Streams, play_streams, read_stream, score_streams
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import AgentError
from syda_gym.simulation.motor_plan import MotorPlan
from syda_gym.simulation.rates import Rates

if TYPE_CHECKING:
    import torch

__all__ = ["BLIND", "PredictorConfig", "TrainedPredictor", "train_predictor"]

BLIND = ("base", "ema", "one_euro", "kalman", "projection")
"""Agents that a predictor can stand on: their commands do not depend on the joint angles."""

TOUCHING_MM = 20.0
"""What a step in contact counts when rounds of training with a contact weight are compared [mm]."""


@dataclass(frozen=True)
class PredictorConfig:
    """Hyper-parameters of the predictor.

    Attributes:
        channels: width of the network.
        iterations: optimiser steps.
        batch: stretches of episodes per step.
        window: control steps of a stretch; the network is shown the steps before it as well.
        learning_rate: the largest; it rises over the first tenth and falls along a cosine.
        weight_decay: of AdamW.
        jitter_weight: of the jitter against the landmark error; 1 trains on the objective ``J`` itself.
        averaging: share of the old in the running average of the weights, which is what is kept.
        strength: of the lead on top.
        bound: largest correction [rad].
        rounds: how often the network is played in the servo model to renew the joint angles it reads, and judged on the
            validation streams.
        mirror: whether to train on left-right mirror images as well.
        contact_weight: of a millimetre by which shapes come nearer than ``contact_margin``, against the landmark error;
            0 leaves contacts out. The base should then be a ``Projection``.
        contact_margin: clearance that costs nothing [m].
    """

    channels: int = 48
    iterations: int = 400
    batch: int = 32
    window: int = 64
    learning_rate: float = 3e-3
    weight_decay: float = 1e-3
    jitter_weight: float = 1.0
    averaging: float = 0.95
    strength: float = 1.0
    bound: float = 0.6
    rounds: int = 3
    mirror: bool = True
    contact_weight: float = 0.0
    contact_margin: float = 0.0005

    def __post_init__(self) -> None:
        for name in ("channels", "iterations", "batch", "window", "rounds"):
            if getattr(self, name) < 1:
                raise AgentError(f"predictor: {name} must be at least 1, got {getattr(self, name)}")
        if self.rounds > self.iterations:
            raise AgentError(f"predictor: {self.rounds} rounds need at least as many iterations, got {self.iterations}")
        if not 0.0 <= self.averaging < 1.0:
            raise AgentError(f"predictor: averaging must be at least 0 and below 1, got {self.averaging}")
        if not (self.contact_weight >= 0.0 and 0.0 <= self.contact_margin <= 0.1):
            raise AgentError(
                "predictor: expected contact_weight >= 0 and 0 <= contact_margin <= 0.1 m, got "
                f"{self.contact_weight} and {self.contact_margin}"
            )


@dataclass(frozen=True, eq=False)
class TrainedPredictor:
    """What training gives.

    Attributes:
        agent: the predictor with the lead on top, as it was best on the validation streams.
        history: figures on the validation streams after each round, the untrained network first.
        best: index into ``history``.
    """

    agent: Agent
    history: tuple[Figures, ...]
    best: int


def train_predictor(
    base: Agent,
    train: Streams,
    validation: Streams,
    rates: Rates,
    config: PredictorConfig | None = None,
    *,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> TrainedPredictor:
    """Trains a predictor on top of an agent.

    The correction is played through the linear part of the servo, ``q += k (c - q)`` with the episode's own motor gain,
    and the loss is the objective ``J`` (landmark error, joint error and jitter by the robot's kinematics). The
    acceleration limit is left out: gradients through it diverge. The untrained network corrects nothing.

    Args:
        base: the agent below, a stack of ``BLIND`` agents.
        train: streams to learn from.
        validation: streams by which the best round is chosen.
        rates: control and physics rate.
        config: hyper-parameters.
        seed: of initialisation and batches; same seed, same weights.
        progress: called with the share that is done.

    Raises:
        AgentError: a base that looks at the joint angles.
    """
    import torch

    settings = config or PredictorConfig()
    looking = [name for name in base.stack if name not in BLIND]
    if looking:
        raise AgentError(
            f"a predictor cannot stand on {looking[0]!r}, whose commands depend on the joint angles; use a stack of "
            f"{', '.join(BLIND)} (the predictor brings its own lead)"
        )
    torch.set_num_threads(1)
    trainer = _Trainer(base, train, rates, settings, seed)
    capsules = capsule_model(base.interface.robot) if settings.contact_weight else None
    history, snapshots = [], []
    per_round = np.diff(np.linspace(0, settings.iterations, settings.rounds + 1).round().astype(int))
    for index in range(settings.rounds + 1):
        snapshots.append(trainer.weights())
        history.append(score_streams(trainer.agent(snapshots[-1]), validation, rates, capsules=capsules))
        if index < settings.rounds:
            trainer.renew()
            trainer.run(int(per_round[index]))
        if progress is not None:
            progress(index / settings.rounds)
    best = int(np.argmin([_cost(figures, settings) for figures in history]))
    return TrainedPredictor(trainer.agent(snapshots[best]), tuple(history), best)


def _cost(figures: Figures, config: PredictorConfig) -> float:
    """By what rounds are compared; a step in contact counts as an error of two centimetres."""
    touching = TOUCHING_MM * figures.contact_steps if config.contact_weight else 0.0
    return figures.landmark_mm + JOINT_WEIGHT * figures.joint_mrad + config.jitter_weight * figures.jitter + touching


class _Known(Agent):
    """Replays commands that were computed before; the agents that it stands for may be slow."""

    name = "known"

    def __init__(self, interface: Interface, commands: FloatArray) -> None:
        super().__init__(interface)
        self._commands = commands

    def reset(self, count: int, seed: int | None = None) -> None:
        """Goes back to the first step."""
        super().reset(count, seed)
        self._step = 0

    def improve(self, command: FloatArray, reading: Reading) -> FloatArray:
        """The command of the next step."""
        self._step += 1
        return self._commands[:, self._step - 1]


class _Trainer:
    """Network, optimiser and data of one training."""

    def __init__(self, base: Agent, train: Streams, rates: Rates, config: PredictorConfig, seed: int) -> None:
        import torch

        from syda_gym.agents.predictor.network import TorchLandmarks, initial_weights, response

        self.base, self.rates, self.config = base, rates, config
        self.interface = base.interface
        self.streams = _with_mirror(self.interface, train) if config.mirror else train
        self._rng = np.random.default_rng(seed)
        n = self.interface.n
        self._parameters = initial_weights(TcnShape(input_count(self.interface), config.channels, n), seed)
        self._average = self._snapshot()
        self._optimiser = torch.optim.AdamW(
            self._parameters.values(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(
            self._optimiser, config.learning_rate, total_steps=config.iterations + 1, pct_start=0.1
        )
        self._below = commands_below(base, self.streams)
        self._kinematics = TorchLandmarks(self.interface)
        self._before = torch.zeros(0)
        self._reference = torch.as_tensor(self.streams.reference, dtype=torch.float32)
        with torch.no_grad():
            self._targets = self._kinematics(self._reference)
        self._mask = torch.as_tensor(self.streams.mask)
        self._window = min(config.window, self.streams.base.shape[1])
        self._shares = _motor_shares(self.streams, rates, config)
        self._response = response(self._shares[:, :1], self._window) if self._shares.shape[1] == 1 else None
        self._inputs = torch.zeros(0)
        self._commands = torch.as_tensor(self._below, dtype=torch.float32)
        self._contact = ContactTerm(self.interface.robot, config.contact_margin) if config.contact_weight else None

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """The running average of the weights."""
        return {name: value.copy() for name, value in self._average.items()}

    def agent(self, weights: dict[str, NDArray[np.float32]]) -> Agent:
        """The stack with given weights."""
        return self._stack(self.base, weights)

    def _stack(self, base: Agent, weights: dict[str, NDArray[np.float32]]) -> Agent:
        c = self.config
        predictor = Predictor(self.interface, base, weights=weights, channels=c.channels, bound=c.bound)
        return Lead(self.interface, predictor, strength=c.strength)

    def renew(self) -> None:
        """Takes the joint angles that the current network leads to as what the network sees next."""
        import torch

        agent = self._stack(_Known(self.interface, self._below), self.weights())
        q_after = play_streams(agent, self.streams, self.rates)
        if self._contact is not None:
            self._contact.renew(q_after)
        before = np.concatenate([self.streams.base[:, :1], q_after[:, :-1]], axis=1)
        last = np.concatenate([self._below[:, :1], self._below[:, :-1]], axis=1)
        preview = self.streams.preview
        inputs = network_inputs(self.interface, self._below, last, preview, before, self.streams.age)
        self._inputs = torch.as_tensor(inputs, dtype=torch.float32)
        self._before = torch.as_tensor(before, dtype=torch.float32)

    def run(self, iterations: int) -> None:
        """Optimises for some iterations."""
        import torch

        for _ in range(iterations):
            rows = self._rng.choice(len(self.streams), min(self.config.batch, len(self.streams)), False)
            latest = np.maximum(self.streams.lengths[rows] - self._window, 0)
            starts = (self._rng.random(len(rows)) * (latest + 1)).astype(np.int64)
            loss = self._loss(torch.as_tensor(rows), torch.as_tensor(starts))
            self._optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            torch.nn.utils.clip_grad_norm_(self._parameters.values(), 1.0)
            self._optimiser.step()
            self._schedule.step()
            self._blend()

    def _powers(self, rows: torch.Tensor, times: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """How the motors of episodes ``rows`` respond in the steps ``times`` ``(B, W)``."""
        from syda_gym.agents.predictor.network import response

        if self._response is None:
            return response(self._shares[rows.numpy()[:, None], times.numpy()], self._window)
        weights, left = self._response
        return weights[rows], left[rows]

    def _blend(self) -> None:
        """Moves the running average towards the weights as they are now."""
        share = 1.0 - self.config.averaging
        for name, value in self._snapshot().items():
            self._average[name] += np.float32(share) * (value - self._average[name])

    def _snapshot(self) -> dict[str, NDArray[np.float32]]:
        return {name: value.detach().numpy().copy() for name, value in self._parameters.items()}

    def _loss(self, rows: torch.Tensor, starts: torch.Tensor) -> torch.Tensor:
        """The objective over stretches that begin at ``starts`` of episodes ``rows``."""
        import torch

        from syda_gym.agents.predictor.network import follow, tcn

        ahead = receptive_field() - 1
        times = starts[:, None] + torch.arange(-ahead, self._window)
        # Before an episode the network takes its past to have been equal to the first step.
        seen = self._inputs[rows[:, None], times.clamp(min=0)]
        at = (rows[:, None], times[:, ahead:])
        bound = self.config.bound
        correction = tcn(self._parameters, seen)[:, ahead:]
        commands = self._commands[at] + bound * torch.tanh(correction / bound)
        q = follow(commands, self._before[rows, starts], self._powers(rows, times[:, ahead:]))
        mask, points, targets = self._mask[at], self._kinematics(q), self._targets[at]
        landmark = 1e3 * _masked(_length(points - targets).mean(-1), mask)
        joint = 1e3 * _masked((q - self._reference[at]).abs().mean(-1), mask)
        jitter = 1e3 * _masked(_length(torch.diff(points, n=3, dim=1)).mean(-1), mask[:, 3:])
        loss = landmark + JOINT_WEIGHT * joint + self.config.jitter_weight * jitter
        if self._contact is not None:
            loss = loss + self.config.contact_weight * _masked(self._contact(at, q), mask)
        return loss


def commands_below(base: Agent, streams: Streams) -> FloatArray:
    """Commands ``(E, T, n)`` of an agent that does not look at joint angles."""
    base.reset(len(streams))
    result = np.empty_like(streams.base)
    for t in range(streams.base.shape[1]):
        q = streams.reference[:, t]
        result[:, t] = base.act_on(read_stream(base.interface, streams, t, q, np.zeros_like(q)))
    return result


def _motor_shares(streams: Streams, rates: Rates, config: PredictorConfig) -> FloatArray:
    """How far a robot with a nominal lead on top gets towards the command in one step.

    ``(E, 1)``, or ``(E, T)`` where motors change within an episode.
    """
    nominal = rates.lag_share
    factor = 1.0 + config.strength * (1.0 / nominal - 1.0)
    steps = streams.base.shape[1] if any(plan.changes for plan in streams.motors) else 1
    plans = streams.motors or (MotorPlan(),) * len(streams)
    gains = np.array([plan.gains(steps) for plan in plans])
    return np.asarray(factor * lag_share(rates.motor_gain * gains, rates.substeps))


def _with_mirror(interface: Interface, streams: Streams) -> Streams:
    from syda_gym.agents.streams.streams import join

    robot = interface.robot

    def turned(array: FloatArray) -> FloatArray:
        return robot.mirror(array.reshape(-1, array.shape[-1])).reshape(array.shape)

    mirrored = replace(
        streams,
        base=turned(streams.base),
        reference=turned(streams.reference),
        ahead=None if streams.ahead is None else turned(streams.ahead),
    )
    return join([streams, mirrored])


def _length(vectors: torch.Tensor) -> torch.Tensor:
    return (vectors.square().sum(-1) + 1e-10).sqrt()


def _masked(values: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    return (values * mask).sum() / mask.sum()
