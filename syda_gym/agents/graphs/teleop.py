"""TeleopGraph: mapping and agent as one module, from the operator's frame to the joint command."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from syda_gym.agents.agent import Agent
from syda_gym.agents.graphs.arithmetic import constant
from syda_gym.agents.graphs.limits import robot_clamp
from syda_gym.agents.graphs.mapping import MappingGraph
from syda_gym.agents.graphs.stack import AgentGraph
from syda_gym.agents.pairing import check_pairing
from syda_gym.errors import AgentError
from syda_gym.mappings.mapping import Mapping

__all__ = ["TeleopGraph"]


class TeleopGraph(nn.Module):
    """What ``Runner.step`` does, for ``B`` robots at once and with an explicit state.

    ``command, base, next_state = graph(frame, q, qd, age, state, fresh)``: operator frames ``(B, F)``, joint angles
    ``(B, n)`` [rad] and speeds ``(B, n)`` [rad/s], age of the frame ``(B, 1)`` [s], state ``(B, S)`` and ``fresh``
    ``(B, 1)``, 1 in the first step of an episode; all float64. ``base`` is what the mapping asks for, as fast as
    the joint speed limits allow (``mappings.limits.step_towards``). The state holds the base, what the mapping's limb
    solver remembers, and what the agent remembers.

    Args:
        agent: the stack.
        mapping: from the operator to the agent's robot.

    Attributes:
        state_size: ``S``.

    Raises:
        AgentError: they do not fit together, or a part of them has no graph.
    """

    def __init__(self, agent: Agent, mapping: Mapping) -> None:
        super().__init__()
        check_pairing(agent, mapping)
        self.mapping, self.agent = MappingGraph(mapping, agent.interface.dt), AgentGraph(agent)
        interface, layout, n = agent.interface, agent.interface.layout, agent.interface.n
        self.n, self.seen = n, n + self.mapping.state_size
        self.state_size = self.seen + self.agent.state_size
        self.step = constant(np.minimum(interface.robot.speed * interface.dt, 1e6))
        self.clamp = robot_clamp(interface.robot)
        if layout["base_error"].stop - layout["base_error"].start != n:
            raise AgentError("an agent that sees a preview of the command has no live graph; train it with preview=0")
        self.blocks = [
            (name, part.stop - part.start) for name, part in sorted(layout.items(), key=lambda item: item[1].start)
        ]

    def forward(
        self, frame: Tensor, q: Tensor, qd: Tensor, age: Tensor, state: Tensor, fresh: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One step of every robot."""
        goal, mapped = self.mapping(frame, state[:, self.n : self.seen], fresh)
        last = torch.where(fresh > 0.5, goal, state[:, : self.n])
        base = self.clamp(last + torch.minimum(torch.maximum(goal - last, -self.step), self.step))
        known = {"operator": frame, "base_error": base - q, "q": q, "qd": qd, "packet_age": age}
        zero = 0.0 * age
        blocks = [known[name] if name in known else zero.repeat(1, width) for name, width in self.blocks]
        command, after = self.agent(torch.cat(blocks, dim=1), state[:, self.seen :], fresh)
        return command, base, torch.cat([base, mapped, after], dim=1)
