"""The general definition of transferability: any two bodies, no epsilon, every term in [0, 1].

It keeps the form of the paper's Eq. 10, T = alpha L [S + (1 - D)(1 - S)], and departs from its terms:

- Manipulability M is the product of the r largest singular values of the tip's Jacobian over all joints and over the
  arm's length (r = 3: sqrt(det J J^T), the paper's). A planar arm has r = 2 and is compared by its two.
- rho = min(1, M_B / M_A) per cell, 0 where B cannot reach. S is the share of A's cells with M_B >= M_A (Eq. 8 with the
  workspace as divisor, as printed) and 1 - D the mean of rho over the others. Instead of Eq. 9, whose divergence is
  infinite where B cannot reach and whose sigmoid never falls below one half. Then C = S + (1 - S)(1 - D) is the mean of
  rho: continuous, directional, and 1 for a body against itself.
- L = min(1, l_B / l_A), Eq. 7 as printed, with l the arm's length instead of the stature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.errors import OptionError
from syda_gym.files import fingerprint
from syda_gym.routes.workspace.sampling import Workspace, chain_fingerprint, sobol_angles, workspace_from_angles
from syda_gym.routes.workspace.store import MEMORY, WorkspaceStore

__all__ = ["GeneralTerms", "Sampling", "compare", "general_workspace"]


@dataclass(frozen=True)
class Sampling:
    """How arms are sampled.

    Attributes:
        samples: scrambled Sobol samples per arm and repeat, a power of two.
        cell: edge of a cell in arm lengths.
        seed: scrambling seed of the first repeat.
        repeats: independent samplings, at least 2; terms are means over them, their spread is reported.
    """

    samples: int = 2**20
    cell: float = 0.1
    seed: int = 0
    repeats: int = 3

    def __post_init__(self) -> None:
        if self.samples < 2**10 or self.samples & (self.samples - 1):
            raise OptionError(f"samples must be a power of two from 1024 on, got {self.samples}; try 2**20")
        if self.repeats < 2:
            raise OptionError(f"repeats must be at least 2 to know the noise, got {self.repeats}")
        if self.seed < 0:
            raise OptionError(f"seed must not be negative, got {self.seed}")


@dataclass(frozen=True)
class GeneralTerms:
    """S, C and coverage of one pair of arms in one repeat; all in [0, 1]."""

    S: float
    C: float
    coverage: float


def general_workspace(
    chain: ArmChain, sampling: Sampling, repeat: int, rank: int, store: WorkspaceStore = MEMORY
) -> Workspace:
    """Mean manipulability per cell over scrambled Sobol samples of the arm's joint limits.

    Args:
        chain: a canonical arm.
        sampling: number of samples, cell edge and seed.
        repeat: which independent sampling, from 0.
        rank: singular values to multiply, 1 to 3.
        store: where workspaces are kept.
    """
    seed = sampling.seed + repeat
    key = fingerprint("general", chain_fingerprint(chain), repr((sampling.samples, sampling.cell, seed, rank)))

    def make() -> Workspace:
        angles = sobol_angles(chain, sampling.samples, seed)
        return workspace_from_angles(chain, angles, sampling.samples, sampling.cell, rank=rank)

    return store.get(key, make)


def compare(a: Workspace, b: Workspace) -> GeneralTerms:
    """Terms of the transfer from ``a`` to ``b``, two workspaces on the same grid.

    Cells where A is singular (M_A = 0) ask nothing of B but its presence.
    """
    reached = a.present
    m_a, m_b, present = a.manipulability[reached], b.manipulability[reached], b.present[reached]
    rho = np.minimum(1.0, np.divide(m_b, m_a, out=np.ones_like(m_a), where=m_a > 0.0))
    rho[~present] = 0.0
    return GeneralTerms(S=float(np.mean(rho >= 1.0)), C=float(rho.mean()), coverage=float(present.mean()))
