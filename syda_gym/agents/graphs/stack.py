"""Agents as torch modules with an explicit state, so that a stack becomes one graph without hidden memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.classical.rivals import Ema, Kalman, Lead, OneEuro
from syda_gym.agents.graphs.arithmetic import constant
from syda_gym.agents.graphs.limits import robot_clamp
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.predictor import AGE_SCALE, GAP_SCALE, STEP_SCALE, Predictor
from syda_gym.agents.learned.tcn import DILATIONS
from syda_gym.errors import AgentError

__all__ = ["AgentGraph"]


@dataclass
class _Parts:
    """What every agent of a stack reads in one step; ``fresh`` is 1 in the first step of an episode, else 0."""

    observation: Tensor
    base: Tensor
    q: Tensor
    age: Tensor
    fresh: Tensor


class _Layer(nn.Module):
    """One agent of a stack: ``(command, parts, state) -> (command, state)``."""

    state_size: int


class AgentGraph(nn.Module):
    """A stack as one function of observation and state.

    ``command, state = graph(observation, state, fresh)`` with the observation ``(B, size)``, the state ``(B, S)``
    (zeros before the first step, at least one column) and ``fresh`` ``(B, 1)``: 1 in the first step of an episode,
    where the state is not read. All in float64: equals ``Agent.act`` up to rounding.

    Args:
        agent: the stack.

    Attributes:
        state_size: ``S``.

    Raises:
        AgentError: the stack holds an agent that cannot be written as a graph (``projection``).
    """

    def __init__(self, agent: Agent) -> None:
        super().__init__()
        self.interface = agent.interface
        layers = _layers(agent)
        self.layers = nn.ModuleList(layers)
        self.sizes = [layer.state_size for layer in layers]
        self.state_size = sum(self.sizes)
        self.limits = _Limits(agent.interface)
        self.n = agent.interface.n
        layout = agent.interface.layout
        self._q = layout["q"]
        self._error = slice(layout["base_error"].start, layout["base_error"].start + self.n)
        self._age = layout["packet_age"]

    def forward(self, observation: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        """One step of every robot."""
        q = observation[:, self._q]
        parts = _Parts(observation, observation[:, self._error] + q, q, observation[:, self._age], fresh)
        command = self.limits(parts.base, parts.base, q)
        states, at = [], 0
        for layer, size in zip(self.layers, self.sizes, strict=True):
            wanted, after = layer(command, parts, state[:, at : at + size])
            command = self.limits(wanted, command, q)
            states.append(after)
            at += size
        return command, torch.cat([*states, state[:, at:] * (1.0 - fresh)], dim=1)


def _layers(agent: Agent) -> list[_Layer]:
    if agent.base is None:
        return []
    makers: dict[type[Agent], Callable[..., _Layer]] = {
        Lead: _LeadGraph,
        Ema: _EmaGraph,
        OneEuro: _OneEuroGraph,
        Kalman: _KalmanGraph,
        Predictor: _PredictorGraph,
        ResidualPolicy: _ResidualGraph,
    }
    if type(agent) not in makers:
        raise AgentError(
            f"agent {agent.name!r} cannot be exported as a graph; export works for "
            f"{', '.join((BaseAlone.name, *(kind.name for kind in makers)))}; run the others with the numpy runner"
        )
    return [*_layers(agent.base), makers[type(agent)](agent)]


class _Limits(nn.Module):
    """``agent.limited``: the speed limit, then joint limits."""

    def __init__(self, interface: Interface) -> None:
        super().__init__()
        self.step = constant(np.minimum(interface.robot.speed * interface.dt / interface.alpha, 1e6))
        self.clamp = robot_clamp(interface.robot)

    def forward(self, command: Tensor, below: Tensor, q: Tensor) -> Tensor:
        least, most = torch.minimum(q - self.step, below), torch.maximum(q + self.step, below)
        limited: Tensor = self.clamp(torch.minimum(torch.maximum(command, least), most))
        return limited


class _LeadGraph(_Layer):
    state_size = 0

    def __init__(self, agent: Lead) -> None:
        super().__init__()
        self.factor = 1.0 + agent.strength * (1.0 / agent.interface.alpha - 1.0)

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        return parts.q + self.factor * (command - parts.q), state


class _EmaGraph(_Layer):
    def __init__(self, agent: Ema) -> None:
        super().__init__()
        self.rate, self.state_size = agent.rate, agent.interface.n

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        mean = _first(parts, command, state + self.rate * (command - state))
        return mean, mean


class _OneEuroGraph(_Layer):
    def __init__(self, agent: OneEuro) -> None:
        super().__init__()
        self.n, self.dt = agent.interface.n, agent.interface.dt
        self.state_size = 3 * self.n
        self.min_cutoff, self.beta = agent.min_cutoff, agent.beta
        self.speed_weight = 1.0 / (1.0 + 1.0 / (2.0 * math.pi * agent.speed_cutoff * self.dt))

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        raw, value, speed = state[:, : self.n], state[:, self.n : 2 * self.n], state[:, 2 * self.n :]
        zero = torch.zeros_like(command)
        speed = _first(parts, zero, speed + self.speed_weight * ((command - raw) / self.dt - speed))
        cutoff = self.min_cutoff + self.beta * speed.abs()
        weight = 1.0 / (1.0 + 1.0 / (2.0 * math.pi * cutoff * self.dt))
        value = _first(parts, command, value + weight * (command - value))
        return value, torch.cat([command, value, speed], dim=1)


class _KalmanGraph(_Layer):
    """State: angles, speeds, three entries of the covariance, and the time since the measured packet was sent."""

    def __init__(self, agent: Kalman) -> None:
        super().__init__()
        self.n, self.dt = agent.interface.n, agent.interface.dt
        self.state_size = 2 * self.n + 4
        self.density, self.variance, self.horizon = agent.process**2, agent.noise**2, agent.horizon

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        n = self.n
        angle = _first(parts, command, state[:, :n])
        speed = _first(parts, torch.zeros_like(command), state[:, n : 2 * n])
        pp = _first(parts, torch.full_like(parts.age, self.variance), state[:, 2 * n : 2 * n + 1])
        pv = _first(parts, torch.zeros_like(parts.age), state[:, 2 * n + 1 : 2 * n + 2])
        vv = _first(parts, torch.ones_like(parts.age), state[:, 2 * n + 2 : 2 * n + 3])
        since = _first(parts, parts.age, state[:, 2 * n + 3 :] + self.dt)
        # Packets are whole control steps apart, so that half a millisecond tells an old one from a new one.
        new = (1.0 - parts.fresh) * (since - parts.age > 5e-4).to(torch.float64)
        step = new * (since - parts.age)
        pp1 = pp + 2.0 * step * pv + step**2 * vv + self.density * step**3 / 3.0
        pv1 = pv + step * vv + self.density * step**2 / 2.0
        vv1 = vv + self.density * step
        gain_angle, gain_speed = pp1 / (pp1 + self.variance), pv1 / (pp1 + self.variance)
        predicted = angle + speed * step
        surprise = command - predicted
        angle = angle + new * (predicted + gain_angle * surprise - angle)
        speed = speed + new * gain_speed * surprise
        pp = pp + new * ((1.0 - gain_angle) * pp1 - pp)
        vv = vv + new * (vv1 - gain_speed * pv1 - vv)
        pv = pv + new * ((1.0 - gain_angle) * pv1 - pv)
        since = since + new * (parts.age - since)
        ahead = since.clamp(0.0, self.horizon)
        return angle + speed * ahead, torch.cat([angle, speed, pp, pv, vv, since], dim=1)


class _PredictorGraph(_Layer):
    """State: the last command, then the past of every block."""

    def __init__(self, agent: Predictor) -> None:
        super().__init__()
        robot = agent.interface.robot
        self.n, self.channels, self.bound = agent.interface.n, agent.channels, agent.bound
        self.state_size = self.n + 2 * sum(DILATIONS) * self.channels
        self.centre = constant((robot.upper + robot.lower) / 2.0)
        self.spread = constant((robot.upper - robot.lower) / 2.0)
        weights = agent.weights
        self.inlet = (constant(weights["inlet.weight"].T), constant(weights["inlet.bias"]))
        self.blocks = [
            ([constant(tap.T) for tap in weights[f"blocks.{i}.weight"]], constant(weights[f"blocks.{i}.bias"]))
            for i in range(len(DILATIONS))
        ]
        self.outlet = (constant(weights["outlet.weight"].T), constant(weights["outlet.bias"]))

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        last = _first(parts, command, state[:, : self.n])
        inputs = torch.cat(
            [
                (command - self.centre) / self.spread,
                (command - last) / STEP_SCALE,
                (parts.base - command) / GAP_SCALE,
                (parts.q - command) / GAP_SCALE,
                parts.age / AGE_SCALE,
            ],
            dim=1,
        )
        hidden = torch.relu(inputs @ self.inlet[0] + self.inlet[1])
        states, at = [command], self.n
        for (taps, bias), dilation in zip(self.blocks, DILATIONS, strict=True):
            width = 2 * dilation * self.channels
            past = _first(parts, hidden.repeat(1, 2 * dilation), state[:, at : at + width])
            middle = dilation * self.channels
            mixed = (
                past[:, : self.channels] @ taps[0]
                + past[:, middle : middle + self.channels] @ taps[1]
                + hidden @ taps[2]
            )
            states.append(torch.cat([past[:, self.channels :], hidden], dim=1))
            hidden = hidden + torch.relu(mixed + bias)
            at += width
        answer = hidden @ self.outlet[0] + self.outlet[1]
        return command + self.bound * torch.tanh(answer / self.bound), torch.cat(states, dim=1)


class _ResidualGraph(_Layer):
    """State: the low-passed correction."""

    def __init__(self, agent: ResidualPolicy) -> None:
        super().__init__()
        self.state_size = agent.interface.n
        self.views = agent.views
        self.signs, self.answer_signs = constant(agent.views.signs), constant(agent.views.answer_signs)
        self.order = torch.as_tensor(agent.views.order)
        self.mean, self.std = constant(agent.mean), constant(agent.std)
        self.scale, self.smoothing = agent.scale, agent.smoothing
        self.activation = torch.tanh if agent.activation == "tanh" else torch.relu
        self.clips = agent.squash == "clip"
        count = len(agent.weights) // 2
        self.dense = [
            (constant(agent.weights[f"layers.{i}.weight"].T), constant(agent.weights[f"layers.{i}.bias"]))
            for i in range(count)
        ]

    def forward(self, command: Tensor, parts: _Parts, state: Tensor) -> tuple[Tensor, Tensor]:
        correction = _first(parts, torch.zeros_like(command), state)
        seen = [parts.observation[:, part] for part in self.views.blocks]
        features = torch.cat([*seen, command - parts.q, correction], dim=1)
        answer = self._answer(features)
        if self.views.each_arm:
            mirrored = self._answer(features[:, self.order] * self.signs)
            answer = torch.cat([answer, mirrored * self.answer_signs], dim=1)
        correction = self.smoothing * correction + (1.0 - self.smoothing) * answer
        return command + self.scale * correction, correction

    def _answer(self, features: Tensor) -> Tensor:
        hidden = ((features - self.mean) / self.std).clamp(-10.0, 10.0)
        for weight, bias in self.dense[:-1]:
            hidden = self.activation(hidden @ weight + bias)
        raw = hidden @ self.dense[-1][0] + self.dense[-1][1]
        return raw.clamp(-1.0, 1.0) if self.clips else torch.tanh(raw)


def _first(parts: _Parts, at_first: Tensor, later: Tensor) -> Tensor:
    """``at_first`` in the first step of an episode, ``later`` in the others."""
    return torch.where(parts.fresh > 0.5, at_first, later)
