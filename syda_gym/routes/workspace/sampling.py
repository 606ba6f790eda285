"""Workspace: where the tip of one arm can go, and how easily it moves there, on a grid of cells.

Positions and Jacobians are divided by the arm's length, so that every workspace lies within the unit ball and the
grid depends on the cell edge alone. Only the Gram matrix G = J J^T is needed for manipulability, and G is carried from
the tip to the shoulder joint by joint: a joint adds one outer product and one planar rotation. All arrays are
component-major, so each operation runs over contiguous rows of samples; chunks stay within the processor's cache.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.kinematics.arm_chain import ArmChain
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.files import fingerprint

__all__ = [
    "TIP",
    "Workspace",
    "arm_length",
    "cell_index",
    "chain_fingerprint",
    "generic_rank",
    "grid_angles",
    "sample_tip",
    "sobol_angles",
    "workspace_from_angles",
]

TIP = 3
"""Index of the tip among the points of an ``ArmChain`` (shoulder, elbow, wrist, tip)."""

_CHUNK = 20_000
_RANK_TOLERANCE = 1e-6
_CELL_LIMITS = (0.02, 0.5)

Angles = Callable[[int, int], FloatArray]


@dataclass(frozen=True, eq=False)
class Workspace:
    """Mean manipulability per cell of a cubic grid around the shoulder.

    Cell ``(i, j, k)`` is centred at ``cell * (i - n, j - n, k - n)`` arm lengths from the shoulder, with
    ``n = (size - 1) / 2``; axes are the body's (x forward, y left, z up), left arms mirrored.

    Attributes:
        cell: edge of a cell as a fraction of the arm's length.
        counts: samples per cell, ``(size, size, size)``.
        manipulability: mean over the samples of each cell, 0 where there are none, ``(size, size, size)``.
        rank: how many singular values are multiplied, 1 to 3.
    """

    cell: float
    counts: NDArray[np.int64]
    manipulability: FloatArray
    rank: int

    @property
    def present(self) -> NDArray[np.bool_]:
        """Cells that at least one sample fell into."""
        return self.counts > 0

    def centres(self, mask: NDArray[np.bool_]) -> FloatArray:
        """Centres ``(K, 3)`` of the cells in ``mask``, in arm lengths from the shoulder."""
        half = (mask.shape[0] - 1) // 2
        centres: FloatArray = (np.argwhere(mask) - half) * self.cell
        return centres


def sobol_angles(chain: ArmChain, samples: int, seed: int) -> Angles:
    """Joint angles that fill the box of joint limits evenly (scrambled Sobol sequence).

    Args:
        chain: the arm.
        samples: how many; a power of two keeps the sequence balanced.
        seed: scrambling seed.

    Returns:
        A function of ``(start, stop)`` that returns angles ``(n, stop - start)`` [rad].
    """
    unit = _sobol(chain.n_joints, samples, seed)
    lower, span = chain.lower[:, None], (chain.upper - chain.lower)[:, None]

    def angles(start: int, stop: int) -> FloatArray:
        return lower + span * unit[:, start:stop]

    return angles


def grid_angles(chain: ArmChain, points: tuple[int, ...]) -> Angles:
    """Joint angles on a full grid over the joint limits, both ends included, the first joint slowest.

    Args:
        chain: the arm.
        points: grid points per joint.

    Returns:
        A function of ``(start, stop)`` that returns angles ``(n, stop - start)`` [rad].
    """
    axes = [np.linspace(low, high, k) for low, high, k in zip(chain.lower, chain.upper, points, strict=True)]

    def angles(start: int, stop: int) -> FloatArray:
        indices = np.unravel_index(np.arange(start, stop), points)
        return np.array([axis[index] for axis, index in zip(axes, indices, strict=True)])

    return angles


def workspace_from_angles(
    chain: ArmChain,
    angles: Angles,
    samples: int,
    cell: float,
    *,
    rank: int = 3,
    columns: tuple[int, ...] | None = None,
) -> Workspace:
    """Samples an arm and averages manipulability per cell.

    Args:
        chain: the arm; its tip and its first joint (the shoulder) span the workspace.
        angles: ``(start, stop) -> (n, stop - start)`` [rad].
        samples: number of samples.
        cell: edge of a cell as a fraction of the arm's length.
        rank: singular values of the Jacobian to multiply: 3 gives sqrt(det(J J^T)).
        columns: joints whose Jacobian columns count; all by default.

    Raises:
        OptionError: the cell edge is out of range.
        EmbodimentError: the arm has no length.
    """
    if not _CELL_LIMITS[0] <= cell <= _CELL_LIMITS[1]:
        raise OptionError(f"cell must lie between {_CELL_LIMITS[0]} and {_CELL_LIMITS[1]} arm lengths, got {cell}")
    half = int(np.ceil(1.0 / cell)) + 1
    size = 2 * half + 1
    counts = np.zeros(size**3, dtype=np.int64)
    sums = np.zeros(size**3)
    for start in range(0, samples, _CHUNK):
        q = angles(start, min(start + _CHUNK, samples))
        position, gram = sample_tip(chain, q, columns)
        index = cell_index(position, cell) + half
        key = (index[0] * size + index[1]) * size + index[2]
        counts += np.bincount(key, minlength=size**3)
        sums += np.bincount(key, weights=_manipulability(gram, rank), minlength=size**3)
    mean = np.divide(sums, counts, out=np.zeros_like(sums), where=counts > 0)
    shape = (size, size, size)
    return Workspace(cell, counts.reshape(shape), mean.reshape(shape), rank)


def cell_index(position: FloatArray, cell: float) -> NDArray[np.int64]:
    """Index of the cell that holds each position: round half away from zero.

    Positions of a regular grid of angles often lie exactly between two cells; rounding to nine decimals first lets
    such ties fall the same way on every machine.
    """
    scaled = np.round(position / cell, 9)
    return np.trunc(scaled + np.copysign(0.5, scaled)).astype(np.int64)


def arm_length(chain: ArmChain) -> float:
    """Sum of the fixed offsets after the first joint, tip included [m]: the farthest the tip can ever be.

    Raises:
        EmbodimentError: the sum is zero.
    """
    offsets = np.linalg.norm(chain.offsets[1:], axis=1).sum()
    length = float(offsets + np.linalg.norm(chain.point_offsets[TIP]))
    if not length > 1e-6:
        raise EmbodimentError(
            f"the {chain.side} arm ({', '.join(chain.joints)}) has zero length; name a tip link beyond the wrist"
        )
    return length


def generic_rank(chain: ArmChain) -> int:
    """Rank of the tip's position Jacobian almost everywhere: 3, or 2 for a planar arm, 1 for a single hinge.

    Raises:
        EmbodimentError: the arm has no length, or its joints never move the tip.
    """
    rng = np.random.default_rng(0)
    q = chain.lower[:, None] + (chain.upper - chain.lower)[:, None] * rng.random((chain.n_joints, 256))
    _, (xx, xy, xz, yy, yz, zz) = sample_tip(chain, q)
    gram = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    singular = np.sqrt(np.maximum(np.linalg.eigvalsh(gram), 0.0))[:, ::-1]
    rank = int(np.sum(singular.max(axis=0) > _RANK_TOLERANCE))
    if rank == 0:
        raise EmbodimentError(f"no joint of the {chain.side} arm ({', '.join(chain.joints)}) moves its tip")
    return rank


def chain_fingerprint(chain: ArmChain) -> str:
    """Identifies the kinematics that the workspace depends on; arms that differ in scale alone are equal."""
    length = arm_length(chain)
    tip, carrier = chain.point_offsets[TIP] / length, chain.point_joints[TIP]
    offsets = chain.offsets[1:] / length
    numbers = [chain.rotations, offsets, chain.axes, chain.lower, chain.upper, tip, np.array([carrier])]
    flat = np.concatenate([np.ravel(part) for part in numbers])
    return fingerprint((np.round(flat, 9) + 0.0).tobytes())


def sample_tip(
    chain: ArmChain, angles: FloatArray, columns: tuple[int, ...] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Tip position relative to the first joint and the Gram matrix of its Jacobian, both over the arm's length.

    Args:
        chain: the arm.
        angles: ``(n, N)`` [rad].
        columns: joints whose Jacobian columns count; all by default.

    Returns:
        Positions ``(3, N)`` in torso axes, and G = J J^T as six rows ``xx, xy, xz, yy, yz, zz``, ``(6, N)``.
    """
    last = chain.point_joints[TIP]
    fixed, offsets, tip = _axes_along_z(chain)
    position = np.repeat(tip[:, None], angles.shape[1], axis=1)
    gram = np.zeros((6, angles.shape[1]))
    for i in range(last, -1, -1):
        if columns is None or i in columns:
            _add_column(gram, position)
        position, gram = _turn_about_z(position, gram, angles[i])
        if i:  # the last rotation, shoulder to torso, changes no singular value
            gram = _conjugation(fixed[i]) @ gram
        position = fixed[i] @ position + offsets[i][:, None]
    return position, gram


def _axes_along_z(chain: ArmChain) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rewrites the chain so that every joint turns about its own z, in arm lengths, the shoulder at the origin.

    Returns:
        Fixed rotations ``(n, 3, 3)``, offsets ``(n, 3)`` (the first one zero), and the tip ``(3,)``.
    """
    length = arm_length(chain)
    frames = [np.eye(3), *[_frame_with_z(axis) for axis in chain.axes]]
    fixed = np.array([frames[i].T @ chain.rotations[i] @ frames[i + 1] for i in range(chain.n_joints)])
    offsets = np.array([frames[i].T @ chain.offsets[i] for i in range(chain.n_joints)]) / length
    offsets[0] = 0.0
    return fixed, offsets, frames[chain.point_joints[TIP] + 1].T @ chain.point_offsets[TIP] / length


def _frame_with_z(axis: FloatArray) -> FloatArray:
    """A rotation whose third column is ``axis``; a signed permutation for the axes of the frame."""
    helper = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    x = helper - axis * (helper @ axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _add_column(gram: FloatArray, position: FloatArray) -> None:
    """Adds the outer product of a joint's Jacobian column z x p = (-y, x, 0), in place."""
    x, y = position[0], position[1]
    gram[0] += y * y
    gram[1] -= x * y
    gram[3] += x * x


def _turn_about_z(position: FloatArray, gram: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turns points and symmetric matrices by their own angles about z."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = position
    xx, xy, xz, yy, yz, zz = gram
    turned_xx = c * c * xx - 2.0 * (c * s) * xy + s * s * yy
    turned = (turned_xx, c * s * (xx - yy) + (c * c - s * s) * xy, c * xz - s * yz, xx + yy - turned_xx,
              s * xz + c * yz, zz)  # fmt: skip
    return np.stack([c * x - s * y, s * x + c * y, z]), np.stack(turned)


def _conjugation(rotation: FloatArray) -> FloatArray:
    """The ``(6, 6)`` matrix that maps the six entries of G to those of R G R^T."""
    rows = np.array([0, 0, 0, 1, 1, 2])
    columns = np.array([0, 1, 2, 1, 2, 2])
    matrix = rotation[rows][:, rows] * rotation[columns][:, columns]
    swapped = rotation[rows][:, columns] * rotation[columns][:, rows]
    result: FloatArray = np.where(rows == columns, matrix, matrix + swapped)
    return result


def _manipulability(gram: FloatArray, rank: int) -> FloatArray:
    """Product of the ``rank`` largest singular values of J, from the entries of J J^T."""
    xx, xy, xz, yy, yz, zz = gram
    if rank == 3:
        determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        volume: FloatArray = np.sqrt(np.maximum(determinant, 0.0))
        return volume
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    largest = np.linalg.eigvalsh(matrix)[:, 3 - rank :]
    result: FloatArray = np.sqrt(np.maximum(largest, 0.0).prod(axis=1))
    return result


@lru_cache(maxsize=6)
def _sobol(dimensions: int, samples: int, seed: int) -> FloatArray:
    """Scrambled Sobol points ``(dimensions, samples)``; cached, because bodies share them."""
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    points: FloatArray = np.ascontiguousarray(engine.random(samples).T)
    points.flags.writeable = False
    return points
