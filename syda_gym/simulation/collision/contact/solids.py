"""Nearest points of axes, boxes and cylinders, in compiled plain loops over plain numbers."""

from __future__ import annotations

import math

from syda_gym.embodiments.limb_ik.compiling import compiled

__all__ = ["points_of_axes", "share_of_axis", "to_solid"]

_POINT = 1e-24  # m^2; an axis whose square is shorter is a point
_PARALLEL = 1e-14
_HALVINGS = 60


@compiled
def points_of_axes(x, y, z, hx, hy, hz, kx, ky, kz):
    """Nearest points of the axes ``c + s h`` and ``d + t k`` with ``s`` and ``t`` within -1 and 1: both shares.

    ``x, y, z`` is ``c - d``. Ericson, *Real-Time Collision Detection* (2005), section 5.1.9, with middles for ends.
    """
    a, e = hx * hx + hy * hy + hz * hz, kx * kx + ky * ky + kz * kz
    along, across = hx * x + hy * y + hz * z, kx * x + ky * y + kz * z
    if a <= _POINT and e <= _POINT:
        return 0.0, 0.0
    if a <= _POINT:
        return 0.0, min(max(across / e, -1.0), 1.0)
    if e <= _POINT:
        return min(max(-along / a, -1.0), 1.0), 0.0
    both = hx * kx + hy * ky + hz * kz
    span = a * e - both * both
    s = min(max((both * across - along * e) / span, -1.0), 1.0) if span > _PARALLEL * a * e else 0.0
    t = (both * s + across) / e
    if t < -1.0 or t > 1.0:
        t = min(max(t, -1.0), 1.0)
        s = min(max((both * t - along) / a, -1.0), 1.0)
    return s, t


@compiled
def to_solid(box, a, b, c, x, y, z):
    """From a point to the nearest of a box or an upright cylinder about the origin: three numbers, all zero inside.

    ``a, b, c`` are half the sides, or radius, anything, half the length.
    """
    if box:
        return min(max(x, -a), a) - x, min(max(y, -b), b) - y, min(max(z, -c), c) - z
    out = math.sqrt(x * x + y * y)
    inward = 0.0 if out <= a else a / out - 1.0
    return inward * x, inward * y, min(max(z, -c), c) - z


@compiled
def _slope(box, a, b, c, x, y, z, hx, hy, hz, share):
    """How the squared distance from a point of an axis grows with its share, halved."""
    u, v, w = to_solid(box, a, b, c, x + share * hx, y + share * hy, z + share * hz)
    return -(u * hx + v * hy + w * hz)


@compiled
def share_of_axis(box, a, b, c, x, y, z, hx, hy, hz):
    """Where on the axis ``(x, y, z) + s (hx, hy, hz)``, ``s`` within -1 and 1, a box or cylinder is nearest.

    The square of the distance from a convex solid is convex and smooth along a line, so that its slope has one zero,
    which a bracket closes in on (the Illinois variant of the false position).
    """
    if hx * hx + hy * hy + hz * hz <= _POINT:
        return 0.0
    low, high = -1.0, 1.0
    below = _slope(box, a, b, c, x, y, z, hx, hy, hz, low)
    if below >= 0.0:
        return low
    above = _slope(box, a, b, c, x, y, z, hx, hy, hz, high)
    if above <= 0.0:
        return high
    side, share = 0, 0.0
    for step in range(_HALVINGS):
        # Now and then a plain halving, where the slope has corners that keep the false position on one side.
        share = 0.5 * (low + high) if step % 8 == 7 else (low * above - high * below) / (above - below)
        slope = _slope(box, a, b, c, x, y, z, hx, hy, hz, share)
        if slope == 0.0 or high - low < 1e-14:
            break
        if slope < 0.0:
            low, below = share, slope
            if side < 0:
                above *= 0.5
            side = -1
        else:
            high, above = share, slope
            if side > 0:
                below *= 0.5
            side = 1
    return share
