"""ContactTerm: what overlap costs while a predictor is trained, differentiable by the joint angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from syda_gym.agents.classical.projection import capsule_model
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot

if TYPE_CHECKING:
    import torch

__all__ = ["ContactTerm"]

_PAIRS = 4
_CHUNK = 2000


class ContactTerm:
    """Mean depth by which shapes come nearer than a margin, in millimetres.

    The distances of the nearest few pairs are linearised about the joint angles that the network's last version led
    to, as in sequential convex collision avoidance (Schulman et al., *Motion Planning with Sequential Convex
    Optimization and Convex Collision Checking*, 2014): ``d(q) = d(q0) + g (q - q0)``, and what is missing to the margin
    is paid for.

    Args:
        robot: whose shapes.
        margin: clearance that costs nothing [m].
    """

    def __init__(self, robot: Robot, margin: float) -> None:
        self.margin = margin
        self._model = capsule_model(robot)

    def renew(self, q: FloatArray) -> None:
        """Linearises about joint angles ``(E, T, n)`` [rad]."""
        import torch

        flat = q.reshape(-1, q.shape[-1])
        found = [self._model.nearest_pairs(chunk, _PAIRS) for chunk in np.array_split(flat, -(-len(flat) // _CHUNK))]
        gradient = np.concatenate([near.gradient for near in found])
        offset = np.concatenate([near.distance for near in found]) - np.einsum("nkj,nj->nk", gradient, flat)
        shape = q.shape[:2]
        self._gradient = torch.as_tensor(gradient.reshape(*shape, *gradient.shape[1:]), dtype=torch.float32)
        self._offset = torch.as_tensor(offset.reshape(*shape, -1), dtype=torch.float32)

    def __call__(self, at: tuple[torch.Tensor, torch.Tensor], q: torch.Tensor) -> torch.Tensor:
        """Depth ``(B, W)`` [mm], summed over pairs.

        Args:
            at: episode and step of each row of ``q``, ``(B, 1)`` and ``(B, W)``.
            q: joint angles ``(B, W, n)`` [rad].
        """
        import torch

        distance = self._offset[at] + torch.einsum("bwkj,bwj->bwk", self._gradient[at], q)
        return 1e3 * torch.relu(self.margin - distance).sum(-1)
