"""The limb solver's arithmetic: plain loops over one arm, compiled by numba, for one frame and for a million alike.

Angles are in radians, ``target`` is the wanted unit upper arm and unit forearm as six numbers in the torso frame, and a
*miss* is the mean length of the two differences of unit vectors (for small angles the mean angle in radians).
"""

from __future__ import annotations

import math

import numpy as np

from syda_gym.embodiments.limb_ik.closed_form import closed_form, unit
from syda_gym.embodiments.limb_ik.compiling import compiled, copy

__all__ = ["follow", "look", "solve", "unit"]

NEAR = 1e-7
"""A miss below this is none."""
REST = 1e-6
"""Cost of being a radian away from rest, squared, in a refinement of a single frame."""
PULL = 1e-6
"""Miss per radian from rest: makes the choice among equally good poses unique."""
STARTS = 3
"""How many of the nearest starts are refined where no closed-form pose lies within the limits."""
STEPS = 30
"""Steps of a refinement at most."""
FLAT = 1e-18
"""Squared slope below which no step gains anything."""
LEAST_GAIN = 1e-11
"""A step that promises less is not taken."""
HALVINGS = 8
"""By how many halvings it is found how far a joint must be held back that another one cannot follow."""
SAME = 1e-3
"""How near a pose must be to the one that it goes to [rad, sum over joints]."""
WAY = 4
"""Poses on the way to another branch at which it is asked what the way costs."""
WITHIN = 1.0 - 1e-9
"""Share of a joint's speed that is used, so that rounding never exceeds it."""
SLACK = 1e-12
"""How near to a limit a joint is at it [rad]."""
DAMPING = 1e-4
"""Of the first step."""
BLUR = 0.2
"""Length of a gap below which its square counts, above which its length does."""

FRAME = 1.0 / 30.0
"""Time step [s] for which the next two are given."""


@compiled
def _away(a, b):
    """Sum of the distances of the joints."""
    total = 0.0
    for i in range(len(a)):
        total += abs(a[i] - b[i])
    return total


@compiled
def _walk(arm, q, points, origins, axes):
    """Shoulder, elbow, wrist; origin and axis of every joint up to the wrist's, in the torso frame."""
    ax, ay, az, bx, by, bz, cx, cy, cz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0  # columns of the rotation
    px = py = pz = 0.0
    for p in range(3):
        if arm.carriers[p] < 0:
            points[p, 0], points[p, 1], points[p, 2] = arm.points[p, 0], arm.points[p, 1], arm.points[p, 2]
    for j in range(len(arm.steps)):
        x, y, z = arm.steps[j, 0], arm.steps[j, 1], arm.steps[j, 2]
        px += ax * x + bx * y + cx * z
        py += ay * x + by * y + cy * z
        pz += az * x + bz * y + cz * z
        origins[j, 0], origins[j, 1], origins[j, 2] = px, py, pz
        u, v, w = arm.axes[j, 0], arm.axes[j, 1], arm.axes[j, 2]
        axes[j, 0] = ax * u + bx * v + cx * w
        axes[j, 1] = ay * u + by * v + cy * w
        axes[j, 2] = az * u + bz * v + cz * w
        s, r = math.sin(q[j]), 2.0 * math.sin(0.5 * q[j]) ** 2  # r = 1 - cos
        c = 1.0 - r
        m00, m01, m02 = c + u * u * r, u * v * r - w * s, u * w * r + v * s
        m10, m11, m12 = u * v * r + w * s, c + v * v * r, v * w * r - u * s
        m20, m21, m22 = u * w * r - v * s, v * w * r + u * s, c + w * w * r
        ax, bx, cx = ax * m00 + bx * m10 + cx * m20, ax * m01 + bx * m11 + cx * m21, ax * m02 + bx * m12 + cx * m22
        ay, by, cy = ay * m00 + by * m10 + cy * m20, ay * m01 + by * m11 + cy * m21, ay * m02 + by * m12 + cy * m22
        az, bz, cz = az * m00 + bz * m10 + cz * m20, az * m01 + bz * m11 + cz * m21, az * m02 + bz * m12 + cz * m22
        for p in range(3):
            if arm.carriers[p] == j:
                x, y, z = arm.points[p, 0], arm.points[p, 1], arm.points[p, 2]
                points[p, 0] = px + ax * x + bx * y + cx * z
                points[p, 1] = py + ay * x + by * y + cy * z
                points[p, 2] = pz + az * x + bz * y + cz * z


@compiled
def look(arm, q, found, columns, turning, places):
    """Directions of both limbs (6,), derivatives (m, 6), and how each mover turns the arm about its length (m,).

    ``places`` ``(3 + 2 k, 3)`` is written over: allocating it at every call would cost a sixth of the time.
    """
    k = len(arm.steps)
    points, origins, axes = places[:3], places[3 : 3 + k], places[3 + k :]
    _walk(arm, q, points, origins, axes)
    for limb in range(2):
        at = 3 * limb
        dx = points[limb + 1, 0] - points[limb, 0]
        dy = points[limb + 1, 1] - points[limb, 1]
        dz = points[limb + 1, 2] - points[limb, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        found[at], found[at + 1], found[at + 2] = dx, dy, dz
        for index in range(len(arm.movers)):
            j = arm.movers[index]
            vx = vy = vz = 0.0
            for end in range(2):
                p = limb + end
                if j <= arm.carriers[p]:
                    x, y, z = points[p, 0] - origins[j, 0], points[p, 1] - origins[j, 1], points[p, 2] - origins[j, 2]
                    sign = 1.0 if end == 1 else -1.0
                    vx += sign * (axes[j, 1] * z - axes[j, 2] * y)
                    vy += sign * (axes[j, 2] * x - axes[j, 0] * z)
                    vz += sign * (axes[j, 0] * y - axes[j, 1] * x)
            along = vx * dx + vy * dy + vz * dz
            columns[index, at] = (vx - along * dx) / length
            columns[index, at + 1] = (vy - along * dy) / length
            columns[index, at + 2] = (vz - along * dz) / length
    for index in range(len(arm.movers)):
        j = arm.movers[index]
        turning[index] = arm.twisting[index] * (axes[j, 0] * found[0] + axes[j, 1] * found[1] + axes[j, 2] * found[2])


@compiled
def _range(arm, which, governor):
    """A coupled limit at one angle of its governor, and its slopes: linear between the rows, constant beyond them."""
    first, last = arm.rows[which], arm.rows[which + 1] - 1
    if not governor > arm.table[first, 0]:
        return arm.table[first, 1], arm.table[first, 2], 0.0, 0.0
    if governor >= arm.table[last, 0]:
        return arm.table[last, 1], arm.table[last, 2], 0.0, 0.0
    i = first
    while arm.table[i + 1, 0] <= governor:
        i += 1
    step, width = governor - arm.table[i, 0], arm.table[i + 1, 0] - arm.table[i, 0]
    rise, climb = (arm.table[i + 1, 1] - arm.table[i, 1]) / width, (arm.table[i + 1, 2] - arm.table[i, 2]) / width
    return rise * step + arm.table[i, 1], climb * step + arm.table[i, 2], rise, climb


@compiled
def _limits(arm, q, lower, upper, low, high, slopes):
    """The box that the coupled limits leave at ``q``, and how its sides move with the governors (c, 2)."""
    copy(lower, low)
    copy(upper, high)
    for which in range(len(arm.governed)):
        j = arm.governed[which]
        a, b, rise, climb = _range(arm, which, q[arm.governors[which]])
        slopes[which, 0] = rise if a >= low[j] else 0.0
        slopes[which, 1] = climb if b <= high[j] else 0.0
        low[j], high[j] = max(low[j], a), min(high[j], b)


@compiled
def _project(arm, q, lower, upper, allowed):
    """Moves ``q`` into the box and the coupled limits, in place.

    Where a range shrinks faster than its joint may move, the governing joint is held back towards ``allowed``, a pose
    within all of them.
    """
    for j in range(len(q)):
        q[j] = min(max(q[j], lower[j]), upper[j])
    for which in range(len(arm.governed)):
        j, by = arm.governed[which], arm.governors[which]
        a, b, _, _ = _range(arm, which, q[by])
        a, b = max(a, lower[j]), min(b, upper[j])
        if a > b:
            start, goal, share, width = allowed[by], q[by], 0.0, 1.0
            for _ in range(HALVINGS):
                width *= 0.5
                a, b, _, _ = _range(arm, which, start + (share + width) * (goal - start))
                if max(a, lower[j]) <= min(b, upper[j]):
                    share += width
            q[by] = start + share * (goal - start)
            a, b, _, _ = _range(arm, which, q[by])
            a, b = max(a, lower[j]), min(b, upper[j])
            if a > b:
                a = b = allowed[j]
        q[j] = min(max(q[j], a), b)
    for which in range(len(arm.governed)):  # couplings that depend on each other
        j = arm.governed[which]
        a, b, _, _ = _range(arm, which, q[arm.governors[which]])
        if q[j] < a - 1e-12 or q[j] > b + 1e-12:
            copy(allowed, q)
            return


@compiled
def _gap(found, target, limb):
    """Squared length of the difference of one limb's unit vectors."""
    x, y, z = found[limb] - target[limb], found[limb + 1] - target[limb + 1], found[limb + 2] - target[limb + 2]
    return x * x + y * y + z * z


@compiled
def _miss(found, target):
    return 0.5 * (math.sqrt(_gap(found, target, 0)) + math.sqrt(_gap(found, target, 3)))


@compiled
def _cost(arm, found, target, q, anchor, hold, firm, turning):
    """What is made small: both limbs' gaps, and how far joints, and the turn of the arm, are from the anchor."""
    total = 0.0
    for limb in (0, 3):
        total += 2.0 * BLUR * (math.sqrt(_gap(found, target, limb) + BLUR * BLUR) - BLUR)
    turn = 0.0
    for index in range(len(arm.movers)):
        away = q[arm.movers[index]] - anchor[arm.movers[index]]
        total += hold * away * away
        turn += turning[index] * away
    return total + firm * turn * turn


@compiled
def _step(matrix, slope, free, step):
    """Solves the positive definite system of the free movers by elimination; the others do not move."""
    m = len(slope)
    for i in range(m):
        step[i] = -slope[i] if free[i] else 0.0
        for j in range(m):
            if not (free[i] and free[j]):
                matrix[i, j] = 1.0 if i == j else 0.0
    for i in range(m):
        for k in range(i + 1, m):
            factor = matrix[k, i] / matrix[i, i]
            for j in range(i, m):
                matrix[k, j] -= factor * matrix[i, j]
            step[k] -= factor * step[i]
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            step[i] -= matrix[i, j] * step[j]
        step[i] /= matrix[i, i]


@compiled
def _tie(arm, q, low, high, slopes, matrix, slope, ties):
    """A joint at a coupled limit that it would leave goes along with its governor: the two become one variable."""
    m = len(slope)
    for which in range(len(arm.governed)):
        ties[which] = 0.0
        j, g = -1, -1
        for i in range(m):
            if arm.movers[i] == arm.governed[which]:
                j = i
            if arm.movers[i] == arm.governors[which]:
                g = i
        if j < 0 or g < 0:
            continue
        angle = q[arm.governed[which]]
        if angle <= low[arm.governed[which]] + SLACK and slope[j] > 0.0:
            ties[which] = slopes[which, 0]
        elif angle >= high[arm.governed[which]] - SLACK and slope[j] < 0.0:
            ties[which] = slopes[which, 1]
        if ties[which] != 0.0:
            slope[g] += ties[which] * slope[j]
            for i in range(m):
                matrix[g, i] += ties[which] * matrix[j, i]
            for i in range(m):
                matrix[i, g] += ties[which] * matrix[i, j]


@compiled
def refine(arm, q, target, lower, upper, anchor, hold, firm):
    """Projected Levenberg-Marquardt from ``q`` within a box and the coupled limits, in place; returns the miss.

    The two gaps count by their length rather than by its square (reweighted least squares), because the mean angle is
    what is wanted least. ``anchor`` is within the box; ``hold`` ties every joint to it and ``firm`` the turn of the arm
    about its own length, linear at the start.
    """
    m = len(arm.movers)
    found, columns, turning = np.empty(6), np.empty((m, 6)), np.empty(m)
    ahead, after, turned = np.empty(6), np.empty((m, 6)), np.empty(m)
    places = np.empty((3 + 2 * len(arm.steps), 3))
    low, high, trial = np.empty(len(q)), np.empty(len(q)), np.empty(len(q))
    matrix, slope, step, free = np.empty((m, m)), np.empty(m), np.empty(m), np.empty(m, np.bool_)
    slopes, ties, weights = np.empty((len(arm.governed), 2)), np.empty(len(arm.governed)), np.empty(6)
    look(arm, anchor, found, columns, turning, places)  # the turn is measured from the anchor
    if _away(q, anchor) > 0.0:
        look(arm, q, found, columns, turned, places)
    else:
        copy(turning, turned)
    cost, damping = _cost(arm, found, target, q, anchor, hold, firm, turning), DAMPING
    for _ in range(STEPS):
        for limb in (0, 3):
            weight = BLUR / math.sqrt(_gap(found, target, limb) + BLUR * BLUR)
            weights[limb] = weights[limb + 1] = weights[limb + 2] = weight
        turn = 0.0
        for i in range(m):
            turn += turning[i] * (q[arm.movers[i]] - anchor[arm.movers[i]])
        for i in range(m):
            slope[i] = hold * (q[arm.movers[i]] - anchor[arm.movers[i]]) + firm * turn * turning[i]
            for d in range(6):
                slope[i] += weights[d] * columns[i, d] * (found[d] - target[d])
            for j in range(m):
                matrix[i, j] = firm * turning[i] * turning[j]
                for d in range(6):
                    matrix[i, j] += weights[d] * columns[i, d] * columns[j, d]
            matrix[i, i] += hold + damping
        _limits(arm, q, lower, upper, low, high, slopes)
        _tie(arm, q, low, high, slopes, matrix, slope, ties)
        steepness = 0.0
        for i in range(m):
            j = arm.movers[i]
            free[i] = not ((q[j] <= low[j] + SLACK and slope[i] > 0.0) or (q[j] >= high[j] - SLACK and slope[i] < 0.0))
            if free[i]:
                steepness += slope[i] * slope[i]
        if steepness < FLAT:
            break
        _step(matrix, slope, free, step)
        copy(q, trial)
        promised = 0.0
        for i in range(m):
            trial[arm.movers[i]] += step[i]
            promised -= slope[i] * step[i]
        for which in range(len(arm.governed)):
            trial[arm.governed[which]] += ties[which] * (trial[arm.governors[which]] - q[arm.governors[which]])
        if promised < LEAST_GAIN:
            break
        _project(arm, trial, lower, upper, anchor)
        look(arm, trial, ahead, after, turned, places)
        reached = _cost(arm, ahead, target, trial, anchor, hold, firm, turning)
        gain = cost - reached
        if gain <= LEAST_GAIN and damping > 10.0:
            break
        # Far from the goal a step overshoots; trust it more only where it delivers what it promises.
        damping = min(max(damping * (0.2 if gain > max(0.0, 0.5 * promised) else 5.0), 1e-7), 1e2)
        if gain > 0.0:
            cost = reached
            copy(trial, q)
            copy(ahead, found)
            for i in range(m):
                copy(after[i], columns[i])
    return _miss(found, target)


@compiled
def solve_arm(arm, target, near, q):
    """The best pose of one arm, among equally good ones the nearest to ``near``, in ``q``; returns the miss."""
    closed = 4 if len(arm.closed) == 4 else 0
    count = closed + len(arm.seeds)
    starts, misses = np.empty((count, len(q))), np.empty(count)
    found, columns, turning = np.empty(6), np.empty((len(arm.movers), 6)), np.empty(len(arm.movers))
    places = np.empty((3 + 2 * len(arm.steps), 3))
    if closed:
        closed_form(arm, target, starts)
    for row in range(len(arm.seeds)):
        copy(arm.seeds[row], starts[closed + row])
    best, least = -1, math.inf
    for row in range(count):
        if row == closed and best >= 0 and misses[best] < NEAR:
            break  # the closed form has it
        _project(arm, starts[row], arm.lower, arm.upper, arm.rest)
        look(arm, starts[row], found, columns, turning, places)
        misses[row] = _miss(found, target)
        score = misses[row] + PULL * _away(starts[row], near)
        if score < least:
            best, least = row, score
    if misses[best] < NEAR:
        copy(starts[best], q)
        return misses[best]
    least, miss = math.inf, math.inf
    for _ in range(min(STARTS, count)):
        row = 0  # the nearest that has not been refined; closed-form poses come first among equals
        for other in range(1, count):
            if misses[other] < misses[row]:
                row = other
        misses[row] = math.inf
        reached = refine(arm, starts[row], target, arm.lower, arm.upper, near, REST, 0.0)
        score = reached + PULL * _away(starts[row], near)
        if score < least:
            least, miss = score, reached
            copy(starts[row], q)
    return miss


@compiled
def _crossing(arm, start, goal, target, staying):
    """What the way to another pose costs beyond staying: the time that it takes by the mean miss on it.

    The elbow goes along, or stays as bent as it is; whatever misses less.
    """
    on_the_way, found = np.empty(len(start)), np.empty(6)
    columns, turning = np.empty((len(arm.movers), 6)), np.empty(len(arm.movers))
    places = np.empty((3 + 2 * len(arm.steps), 3))
    longest, total = 0.0, 0.0
    for stop in range(WAY):
        share = (stop + 1.0) / (WAY + 1.0)
        for j in range(len(start)):
            on_the_way[j] = start[j] + share * (goal[j] - start[j])
            longest = max(longest, abs(goal[j] - start[j]) / arm.speed[j])
        look(arm, on_the_way, found, columns, turning, places)
        miss = _miss(found, target)
        on_the_way[arm.hinge] = start[arm.hinge]
        look(arm, on_the_way, found, columns, turning, places)
        total += max(0.0, min(miss, _miss(found, target)) - staying)
    return longest * total / WAY


@compiled
def follow_arm(arm, target, dt, limited, fresh, state):
    """The next pose of one arm, in place in its state: pose, goal pose, regret [s], on the way, flexion.

    ``target`` holds the wanted directions ``(6,)``, ``dt`` the time since the frame before [s]; ``limited`` says if
    joint speeds hold, ``fresh`` whether there is no frame before; ``state`` is ``(2 n + 3,)``.
    """
    n = len(arm.lower)
    before, goal, q, other = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    lower, upper = np.empty(n), np.empty(n)
    for j in range(n):
        before[j], goal[j], lower[j], upper[j] = state[j], state[n + j], arm.lower[j], arm.upper[j]
    x = target[1] * target[5] - target[2] * target[4]
    y = target[2] * target[3] - target[0] * target[5]
    z = target[0] * target[4] - target[1] * target[3]
    flexion = math.sqrt(x * x + y * y + z * z)
    if fresh:
        solve_arm(arm, target, arm.rest, before)
        for j in range(n):
            state[j] = state[n + j] = before[j]
        state[2 * n], state[2 * n + 1], state[2 * n + 2] = 0.0, 0.0, flexion
        return
    bend = state[2 * n + 2]
    bend = min(flexion, bend + (flexion - bend) * dt / (dt + arm.habits.opening))
    going = state[2 * n + 1] > 0.5
    if limited:
        for j in range(n):
            reach = arm.speed[j] * dt * WITHIN
            lower[j], upper[j] = max(lower[j], before[j] - reach), min(upper[j], before[j] + reach)
    # The tighter in time frames follow, the less each may move what it hardly shows.
    hold = arm.habits.glue * FRAME / dt
    firm = min(arm.habits.firm, arm.habits.stiff / (bend * bend * bend * bend + 1e-12)) * FRAME / dt
    patience = state[2 * n]
    copy(before, q)
    miss = math.inf
    if not going:
        miss = refine(arm, q, target, lower, upper, before, hold, firm)
    if miss < arm.habits.calm:
        copy(q, goal)
        patience = 0.0
    else:
        # Where this branch leads without speed limits, and where the best of all branches is.
        copy(goal, other)
        along = refine(arm, goal, target, arm.lower, arm.upper, other, REST, 0.0)
        gain = along - arm.habits.margin  # if the best pose hit the directions; where that cannot pay, nobody searches
        if patience + gain * dt > 0.0:
            best = solve_arm(arm, target, before, other)
            patience = max(0.0, patience + (along - best - arm.habits.margin) * dt)
        else:
            patience = 0.0
        if patience > arm.habits.patience and patience > _crossing(arm, before, other, target, along):
            copy(other, goal)
            patience, going = 0.0, True
        if going:  # another branch is never jumped to
            for j in range(n):
                reach = arm.speed[j] * dt * WITHIN
                lower[j], upper[j] = max(lower[j], before[j] - reach), min(upper[j], before[j] + reach)
            copy(goal, q)
            _project(arm, q, lower, upper, before)
            copy(q, other)
            for j in range(n):  # the elbow bends as the limbs want it while the other joints are on their way
                if j != arm.hinge:
                    lower[j] = upper[j] = q[j]
            miss = refine(arm, q, target, lower, upper, other, hold, 0.0)
            going = miss >= arm.habits.calm and _away(q, goal) > SAME
        elif not limited:
            copy(q, goal)
    for j in range(n):
        state[j], state[n + j] = q[j], goal[j]
    state[2 * n], state[2 * n + 1], state[2 * n + 2] = patience, 1.0 if going else 0.0, bend


@compiled
def solve(arm, targets, frames):
    """Independent frames: targets (N, 6) to angles (N, n) of one arm."""
    for row in range(len(targets)):
        solve_arm(arm, targets[row], arm.rest, frames[row])


@compiled
def follow(arm, targets, dt, limited, fresh, states, frames):
    """Sequences: targets (B, T, 6), times (B, T) [s], fresh (B,), states (B, S) changed in place, angles (B, T, n)."""
    n = len(arm.lower)
    for b in range(len(targets)):
        for t in range(targets.shape[1]):
            follow_arm(arm, targets[b, t], dt[b, t], limited, fresh[b] and t == 0, states[b])
            for j in range(n):
                frames[b, t, j] = states[b, j]
