"""looking: what touches at some poses, how far pairs are apart, and how that changes; compiled plain loops.

Where two shapes have no closed form, or their cores meet, a pair is left *open*: who asked looks at it by other means.
Slices of arrays are avoided inside the loops over pairs: numba counts references to each of them.
"""

from __future__ import annotations

import math

import numpy as np

from syda_gym.embodiments.limb_ik.compiling import compiled
from syda_gym.simulation.collision.contact.solids import points_of_axes, share_of_axis, to_solid

__all__ = ["measure", "near", "suspects", "touching"]

_ROUND, _BOX = 0, 1  # as in ``shapes``, where solids are above 0 and others below
_NOTHING = 1e-12  # m^2; a line between two cores whose square is shorter has no direction
_FAR, _KNOWN, _MET, _OPEN = 0, 1, 2, 3


@compiled
def _place_joints(shapes, q, joints):
    """Rotation, origin and axis of every joint in the torso's axes (J, 5, 3)."""
    for i in range(3):
        for j in range(5):
            joints[0, j, i] = 1.0 if i == j else 0.0
    for n in range(1, len(joints)):
        parent, angle = shapes.links[n, 0], q[shapes.links[n, 1]]
        u, v, w = shapes.places[n, 4, 0], shapes.places[n, 4, 1], shapes.places[n, 4, 2]
        s, r = math.sin(angle), 2.0 * math.sin(0.5 * angle) ** 2  # r = 1 - cos
        c = 1.0 - r
        m00, m01, m02 = c + u * u * r, u * v * r - w * s, u * w * r + v * s
        m10, m11, m12 = u * v * r + w * s, c + v * v * r, v * w * r - u * s
        m20, m21, m22 = u * w * r - v * s, v * w * r + u * s, c + w * w * r
        for i in range(3):
            a, b, d = joints[parent, i, 0], joints[parent, i, 1], joints[parent, i, 2]
            x = a * shapes.places[n, 0, 0] + b * shapes.places[n, 1, 0] + d * shapes.places[n, 2, 0]
            y = a * shapes.places[n, 0, 1] + b * shapes.places[n, 1, 1] + d * shapes.places[n, 2, 1]
            z = a * shapes.places[n, 0, 2] + b * shapes.places[n, 1, 2] + d * shapes.places[n, 2, 2]
            joints[n, i, 0] = x * m00 + y * m10 + z * m20
            joints[n, i, 1] = x * m01 + y * m11 + z * m21
            joints[n, i, 2] = x * m02 + y * m12 + z * m22
            joints[n, 3, i] = (
                joints[parent, 3, i]
                + a * shapes.places[n, 3, 0]
                + b * shapes.places[n, 3, 1]
                + d * shapes.places[n, 3, 2]
            )
            joints[n, 4, i] = x * u + y * v + z * w


@compiled
def _place(shapes, q, joints, placed):
    """As ``_place_joints``; and middle, half axis, and axes of every shape's solid in the torso's axes (S, 5, 3)."""
    _place_joints(shapes, q, joints)
    for s in range(len(placed)):
        n, kind = shapes.kinds[s, 0], shapes.kinds[s, 1]
        for row in range(5 if kind > 0 else 2):
            if row < 2:
                x, y, z = shapes.solids[s, row, 0], shapes.solids[s, row, 1], shapes.solids[s, row, 2]
            else:  # its columns become rows
                x, y, z = shapes.solids[s, 2, row - 2], shapes.solids[s, 3, row - 2], shapes.solids[s, 4, row - 2]
            for i in range(3):
                placed[s, row, i] = joints[n, i, 0] * x + joints[n, i, 1] * y + joints[n, i, 2] * z
        for i in range(3):
            placed[s, 0, i] += joints[n, 3, i]


@compiled
def _round_pair(shapes, placed, f, s):
    """Distance of two balls or capsules, nearest point of the first one's core, and the way to the second's."""
    cx, cy, cz = placed[f, 0, 0], placed[f, 0, 1], placed[f, 0, 2]
    dx, dy, dz = placed[s, 0, 0], placed[s, 0, 1], placed[s, 0, 2]
    hx, hy, hz = placed[f, 1, 0], placed[f, 1, 1], placed[f, 1, 2]
    kx, ky, kz = placed[s, 1, 0], placed[s, 1, 1], placed[s, 1, 2]
    p, t = points_of_axes(cx - dx, cy - dy, cz - dz, hx, hy, hz, kx, ky, kz)
    cx, cy, cz = cx + p * hx, cy + p * hy, cz + p * hz
    dx, dy, dz = dx + t * kx - cx, dy + t * ky - cy, dz + t * kz - cz
    distance = math.sqrt(dx * dx + dy * dy + dz * dz) - (shapes.radii[f, 0] + shapes.radii[s, 0])
    return distance, cx, cy, cz, dx, dy, dz


@compiled
def _axis_and_solid(shapes, placed, f, s):
    """Distance of a ball or capsule (of others: the ball about them) from a solid, and the same as above."""
    cx, cy, cz = placed[f, 0, 0], placed[f, 0, 1], placed[f, 0, 2]
    hx, hy, hz = placed[f, 1, 0], placed[f, 1, 1], placed[f, 1, 2]
    dx, dy, dz = cx - placed[s, 0, 0], cy - placed[s, 0, 1], cz - placed[s, 0, 2]
    x = placed[s, 2, 0] * dx + placed[s, 2, 1] * dy + placed[s, 2, 2] * dz
    y = placed[s, 3, 0] * dx + placed[s, 3, 1] * dy + placed[s, 3, 2] * dz
    z = placed[s, 4, 0] * dx + placed[s, 4, 1] * dy + placed[s, 4, 2] * dz
    u = placed[s, 2, 0] * hx + placed[s, 2, 1] * hy + placed[s, 2, 2] * hz
    v = placed[s, 3, 0] * hx + placed[s, 3, 1] * hy + placed[s, 3, 2] * hz
    w = placed[s, 4, 0] * hx + placed[s, 4, 1] * hy + placed[s, 4, 2] * hz
    box, a, b, c = shapes.kinds[s, 1] == _BOX, shapes.solids[s, 5, 0], shapes.solids[s, 5, 1], shapes.solids[s, 5, 2]
    p = share_of_axis(box, a, b, c, x, y, z, u, v, w)
    x, y, z = to_solid(box, a, b, c, x + p * u, y + p * v, z + p * w)
    distance = math.sqrt(x * x + y * y + z * z) - shapes.radii[f, 0]
    return (
        distance,
        cx + p * hx,
        cy + p * hy,
        cz + p * hz,
        placed[s, 2, 0] * x + placed[s, 3, 0] * y + placed[s, 4, 0] * z,
        placed[s, 2, 1] * x + placed[s, 3, 1] * y + placed[s, 4, 1] * z,
        placed[s, 2, 2] * x + placed[s, 3, 2] * y + placed[s, 4, 2] * z,
    )


@compiled
def _apart(shapes, placed, f, s, limit):
    """What is known of a pair, its distance, a nearest point of a core, and the way from the first to the second.

    A pair that is ``_FAR`` is at least ``limit`` apart; of an ``_OPEN`` one the distance is a lower bound; where cores
    have ``_MET``, there is no way.
    """
    x, y, z = placed[s, 0, 0] - placed[f, 0, 0], placed[s, 0, 1] - placed[f, 0, 1], placed[s, 0, 2] - placed[f, 0, 2]
    bound = math.sqrt(x * x + y * y + z * z) - shapes.radii[f, 1] - shapes.radii[s, 1]
    cx = cy = cz = 0.0
    if bound >= limit:
        return _FAR, bound, cx, cy, cz, x, y, z
    one, other = shapes.kinds[f, 1], shapes.kinds[s, 1]
    # Of two solids, the greater stays as it is and the ball is about the smaller.
    swapped = one > 0 and (other <= 0 or shapes.radii[f, 0] > shapes.radii[s, 0])
    if one == _ROUND and other == _ROUND:
        known = True
        distance, cx, cy, cz, x, y, z = _round_pair(shapes, placed, f, s)
    elif swapped:
        known = other == _ROUND
        distance, cx, cy, cz, x, y, z = _axis_and_solid(shapes, placed, s, f)
        x, y, z = -x, -y, -z
    elif other > 0:
        known = one == _ROUND
        distance, cx, cy, cz, x, y, z = _axis_and_solid(shapes, placed, f, s)
    else:
        known, distance = False, bound
    if distance >= limit:
        return _FAR, distance, cx, cy, cz, x, y, z
    if not known:
        return _OPEN, distance, cx, cy, cz, x, y, z
    return _MET if x * x + y * y + z * z < _NOTHING else _KNOWN, distance, cx, cy, cz, x, y, z


@compiled
def suspects(weights, room, start, poses):
    """Pairs that a turn from ``start`` to anywhere in the box of the poses (k, n) may bring nearer than ``room``.

    ``weights`` (pairs, n) say by how much each joint's turn brings a pair nearer at most.
    """
    turned, found, count = np.zeros(len(start)), np.empty(len(room), np.int64), 0
    for row in range(len(poses)):
        for j in range(len(start)):
            turned[j] = max(turned[j], abs(poses[row, j] - start[j]))
    for pair in range(len(room)):
        nearer = 0.0
        for j in range(len(start)):
            nearer += weights[pair, j] * turned[j]
        if nearer >= room[pair]:
            found[count] = pair
            count += 1
    return found[:count].copy()


@compiled
def touching(shapes, poses, pairs, margin, opened):
    """Whether any pair is nearer than ``margin`` at any pose; the last pose is looked at first.

    Pairs that would have to be looked at by other means are marked in ``opened`` (poses, pairs), where none touches.
    """
    joints, placed = np.empty((len(shapes.links), 5, 3)), np.empty((len(shapes.kinds), 5, 3))
    for row in range(len(poses) - 1, -1, -1):
        _place(shapes, poses[row], joints, placed)
        for index in range(len(pairs)):
            f, s = shapes.pairs[pairs[index], 0], shapes.pairs[pairs[index], 1]
            state = _apart(shapes, placed, f, s, margin)[0]
            opened[row, index] = state == _OPEN
            if _FAR < state < _OPEN:
                return True
    return False


@compiled
def measure(shapes, q, distances, opened):
    """Distances of all pairs; lower bounds of those that are marked in ``opened``."""
    joints, placed = np.empty((len(shapes.links), 5, 3)), np.empty((len(shapes.kinds), 5, 3))
    _place(shapes, q, joints, placed)
    for index in range(len(shapes.pairs)):
        found = _apart(shapes, placed, shapes.pairs[index, 0], shapes.pairs[index, 1], math.inf)
        distances[index] = found[1]
        opened[index] = found[0] > _KNOWN


@compiled
def near(shapes, q, pairs, within, distances, gradients, states):
    """Distances of the pairs nearer than ``within`` and how they change with the angles (pairs, n).

    States: 0 for a pair that is further apart, 1 for one that is not, 2 for one that is open.
    """
    joints, placed = np.empty((len(shapes.links), 5, 3)), np.empty((len(shapes.kinds), 5, 3))
    _place(shapes, q, joints, placed)
    for index in range(len(pairs)):
        f, s = shapes.pairs[pairs[index], 0], shapes.pairs[pairs[index], 1]
        state, distances[index], cx, cy, cz, dx, dy, dz = _apart(shapes, placed, f, s, within)
        states[index] = min(state, 2)
        if state != _KNOWN:
            continue
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        for n in range(1, len(joints)):
            carried = shapes.above[n, shapes.kinds[f, 0]]
            if carried == shapes.above[n, shapes.kinds[s, 0]]:
                continue  # it moves neither, or both together
            # Along the way between the nearest points, every point of either has the same lever.
            x, y, z = cx - joints[n, 3, 0], cy - joints[n, 3, 1], cz - joints[n, 3, 2]
            u, v, w = joints[n, 4, 0], joints[n, 4, 1], joints[n, 4, 2]
            speed = (dx * (v * z - w * y) + dy * (w * x - u * z) + dz * (u * y - v * x)) / length
            gradients[index, shapes.links[n, 1]] = -speed if carried else speed
