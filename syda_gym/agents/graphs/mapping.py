"""MappingGraph: a fitted mapping, or a chain of them, as one module."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from syda_gym.agents.graphs.coders import decoder_of, encoder_of
from syda_gym.agents.graphs.limits import robot_clamp
from syda_gym.agents.graphs.regressors import regressor_graph
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError
from syda_gym.mappings.chain import ChainMapping
from syda_gym.mappings.coded_mapping import CodedMapping
from syda_gym.mappings.mapping import Mapping

__all__ = ["MappingGraph"]


class MappingGraph(nn.Module):
    """Frames ``(B, F_source)`` to frames ``(B, F_target)``: calibration, code, model, inverse kinematics and limits.

    Equals ``mapping.follow`` frame by frame up to the rounding of float64, with the state that it keeps as numbers.

    Args:
        mapping: what to write.
        dt: time between frames [s].

    Attributes:
        state_size: numbers of the state, all links together.

    Raises:
        AgentError: a part of the mapping has no graph; the message names it and says which have.
    """

    def __init__(self, mapping: Mapping, dt: float) -> None:
        super().__init__()
        links = mapping.links if isinstance(mapping, ChainMapping) else (mapping,)
        parts = [_Link(link, dt) for link in links]
        self.links = nn.ModuleList(parts)
        self.sizes = [part.state_size for part in parts]
        self.state_size = sum(self.sizes)

    def forward(self, frames: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        """The mapped frames and the next state ``(B, S)``; the state is not read where ``fresh`` ``(B, 1)`` is 1."""
        after = []
        for link, own in zip(self.links, torch.split(state, self.sizes, dim=1), strict=True):
            frames, remembered = link(frames, own, fresh)
            after.append(remembered)
        return frames, torch.cat(after, dim=1)


class _Link(nn.Module):
    def __init__(self, link: Mapping, dt: float) -> None:
        super().__init__()
        if not isinstance(link, CodedMapping):
            raise AgentError(f"{link!r} cannot be written as a graph; fitted mappings and chains of them can")
        self.codes = nn.Sequential(
            encoder_of(link.source_coder), regressor_graph(link.regressor, link.source_coder.width)
        )
        self.decoder, self.state_size = decoder_of(link.target_coder, dt)
        self.clamp = robot_clamp(link.target) if isinstance(link.target, Robot) else nn.Identity()

    def forward(self, frames: Tensor, state: Tensor, fresh: Tensor) -> tuple[Tensor, Tensor]:
        mapped, after = self.decoder(self.codes(frames), state, fresh)
        return self.clamp(mapped), after
