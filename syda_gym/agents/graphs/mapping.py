"""MappingGraph: a fitted mapping, or a chain of them, as one module."""

from __future__ import annotations

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

    Equals ``mapping(frame)`` frame by frame up to the rounding of float64.

    Args:
        mapping: what to write.

    Raises:
        AgentError: a part of the mapping has no graph; the message names it and says which have.
    """

    def __init__(self, mapping: Mapping) -> None:
        super().__init__()
        links = mapping.links if isinstance(mapping, ChainMapping) else (mapping,)
        self.links = nn.Sequential(*(_link(link) for link in links))

    def forward(self, frames: Tensor) -> Tensor:
        """The mapped frames."""
        mapped: Tensor = self.links(frames)
        return mapped


def _link(link: Mapping) -> nn.Module:
    if not isinstance(link, CodedMapping):
        raise AgentError(f"{link!r} cannot be written as a graph; fitted mappings and chains of them can")
    return nn.Sequential(
        encoder_of(link.source_coder),
        regressor_graph(link.regressor, link.source_coder.width),
        decoder_of(link.target_coder),
        robot_clamp(link.target) if isinstance(link.target, Robot) else nn.Identity(),
    )
