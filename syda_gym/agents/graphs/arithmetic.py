"""Arithmetic in float64 made of operators that onnxruntime has in float64.

Its processors know sine, but neither cosine nor arc tangent, in double precision. A graph in single precision would
choose another branch of the inverse kinematics than the library in some frames, so the missing ones are made here.
"""

from __future__ import annotations

import math

import torch
from numpy.typing import ArrayLike
from torch import Tensor

__all__ = ["angle_of", "constant", "cosine", "cross", "dot", "norm", "wrapped"]

_NEXT = [1, 2, 0]
_AFTER_NEXT = [2, 0, 1]
_TINY = 1e-150


def constant(value: ArrayLike) -> Tensor:
    """A float64 constant."""
    return torch.as_tensor(value, dtype=torch.float64).clone()


def cosine(angle: Tensor) -> Tensor:
    """Cosine."""
    return torch.sin(angle + math.pi / 2.0)


def angle_of(y: Tensor, x: Tensor) -> Tensor:
    """``atan2(y, x)`` in double precision; 0 where both are 0.

    The arc tangent of single precision is off by ``d`` of about 1e-7, and ``sin(d)`` is known exactly, so that one
    step of correction leaves nothing but rounding.
    """
    length = torch.sqrt(x * x + y * y).clamp(min=_TINY)
    right = x.abs()
    rough = 2.0 * torch.atan((y / (length + right)).to(torch.float32)).to(torch.float64)
    angle = rough + (y * cosine(rough) - right * torch.sin(rough)) / length
    return torch.where(x < 0.0, torch.where(y < 0.0, -math.pi - angle, math.pi - angle), angle)


def wrapped(angle: Tensor, middle: Tensor) -> Tensor:
    """The angle by whole turns within half a turn of ``middle``."""
    shifted = angle - middle + math.pi
    return middle + shifted - 2.0 * math.pi * torch.floor(shifted / (2.0 * math.pi)) - math.pi


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Scalar product along the last axis, which stays with length 1."""
    return (a * b).sum(dim=-1, keepdim=True)


def norm(a: Tensor) -> Tensor:
    """Length along the last axis, which stays with length 1."""
    return torch.sqrt(dot(a, a))


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Vector product along the last axis."""
    return a[..., _NEXT] * b[..., _AFTER_NEXT] - a[..., _AFTER_NEXT] * b[..., _NEXT]
