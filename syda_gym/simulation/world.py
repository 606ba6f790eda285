"""World: robots in PyBullet clients, commanded joint by joint and read back without waste."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.simulation.agreement import check_agreement
from syda_gym.simulation.backend import NOMINAL, MotorConditions
from syda_gym.simulation.plain_body import PlainBody, disabled_pairs, plain_body
from syda_gym.simulation.quiet import quiet
from syda_gym.simulation.rates import Rates

__all__ = ["ROBOTS_PER_CLIENT", "World"]

ROBOTS_PER_CLIENT = 16
"""More robots in one client slow its solver down (by a third at 32)."""

_logger = logging.getLogger("syda_gym.simulation")
_told: set[str] = set()  # robots whose links touch at rest

_HOLD_FORCE = 1e5  # N m; legs and head are no subject of the simulation and stand like a rock
_GRAVITY = (0.0, 0.0, -9.81)
_FIXED, _MOVING = (2, ~2), (1, -1)  # collision group and mask


class World:
    """``count`` robots of one kind in PyBullet, all with their torso at the origin, upright.

    Robots overlap in space but never touch each other: collisions are filtered out, or, with self-collision, each robot
    has a client of its own. That makes a robot's motion independent of how many others there are, bit for bit.
    Position motors follow ``kp = rates.motor_gain`` with the URDF's efforts and joint speeds as limits. Joints that are
    not arm joints are held at the robot's rest pose.

    Args:
        robot: the kind of robot.
        rates: control and physics rate.
        count: number of robots.
        self_collision: whether a robot's links collide with each other, except the pairs that its description disables.
        whole_body: whether joints that are no arm joints (head, hip, knee, wheels) are simulated, too, each held by a
            motor of its own, and links on fixed joints each by itself. Without, they are one with what carries them,
            which costs a fraction and moves the arms alike (``scripts/benchmark_environment.py``). With self-collision
            the whole body is always simulated, since contacts are counted by links.

    Raises:
        OptionError: ``count`` is not positive.
        EmbodimentError: PyBullet cannot load the URDF or lacks one of its joints.
    """

    def __init__(
        self, robot: Robot, rates: Rates, count: int = 1, *, self_collision: bool = False, whole_body: bool = False
    ) -> None:
        if count < 1:
            raise OptionError(f"a world needs at least one robot, got {count}")
        self.robot = robot
        self.rates = rates
        self.count = count
        self.self_collision = self_collision
        import pybullet

        self._bullet = pybullet  # kept, because nothing can be imported while the interpreter shuts down
        self._clients: list[int] = []
        self._puppets: list[_Puppet] = []
        per_client = 1 if self_collision else ROBOTS_PER_CLIENT
        body = plain_body(robot, ("collision",) if self_collision else (), whole=whole_body or self_collision)
        try:
            for first in range(0, count, per_client):
                client = _connect(rates)
                self._clients.append(client)
                for _ in range(min(per_client, count - first)):
                    self._puppets.append(_Puppet(robot, rates, client, self_collision, body))
            check_agreement(robot, self._puppets[0])
        except BaseException:
            self.close()
            raise
        self._pose = np.zeros((count, 0))
        self._qd = np.zeros((count, 0))
        self._pending: list[float] | None = None
        self.contacts = np.zeros(count, dtype=np.int64)
        self._settle(robot.rest.tolist())
        self.reset(np.arange(count), np.repeat(robot.rest[None], count, axis=0))

    def reset(self, which: NDArray[np.intp], q: FloatArray) -> None:
        """Puts robots ``which`` ``(k,)`` at rest at joint angles ``q`` ``(k, n)`` [rad]; nothing is reloaded."""
        n = len(self.robot.joint_names)
        if len(which) == self.count:
            width = n + self._puppets[0].n_points
            self._pose, self._qd, self._pending = np.empty((self.count, width)), np.zeros((self.count, n)), None
            self.contacts = np.zeros(self.count, dtype=np.int64)
        for index, angles in zip(which.tolist(), q.tolist(), strict=True):
            puppet = self._puppets[index]
            puppet.reset(angles)
            row = puppet.read()
            self._pose[index], self._qd[index] = row[:-n], row[-n:]
            self.contacts[index] = puppet.contacts() if self.self_collision else 0

    def _settle(self, rest: list[float]) -> None:
        """One step, after which every reset leads to the same bits; the first one ever would not."""
        for puppet in self._puppets:
            puppet.reset(rest)
        for client in self._clients:
            self._bullet.stepSimulation(client)
        if self.self_collision:
            for puppet in self._puppets:
                puppet.reset(rest)
                puppet.remember()

    def set_conditions(self, index: int, conditions: MotorConditions) -> None:
        """Changes motors and payload of one robot until they are changed again."""
        self._puppets[index].set_conditions(conditions)

    @property
    def pose(self) -> FloatArray:
        """``(B, n + 6 * arms)``: joint angles [rad], then the landmarks' coordinates [m] in the torso frame."""
        if self._pending is not None:
            self._take(np.array([self._pending]))
        return self._pose

    @property
    def qd(self) -> FloatArray:
        """``(B, n)`` joint speeds [rad/s]."""
        if self._pending is not None:
            self._take(np.array([self._pending]))
        return self._qd

    def _take(self, state: FloatArray) -> None:
        """Splits rows of joint angles, landmark coordinates and joint speeds into the state arrays."""
        split = state.shape[1] - len(self.robot.joint_names)
        self._pose, self._qd, self._pending = state[:, :split], state[:, split:], None

    def let_go(self) -> None:
        """Copies the state arrays, so that a reset of some robots does not write into arrays that others hold."""
        self._pose, self._qd, self.contacts = self.pose.copy(), self.qd.copy(), self.contacts.copy()

    def advance(self, commands: FloatArray) -> None:
        """Lets every robot follow its command ``(B, n)`` [rad] for one control step."""
        for puppet, command in zip(self._puppets, commands.tolist(), strict=True):
            puppet.command(command)
        self._simulate()
        self._take(np.array([puppet.read() for puppet in self._puppets]))
        if self.self_collision:
            self.contacts = np.array([puppet.contacts() for puppet in self._puppets], dtype=np.int64)

    def advance_one(self, command: list[float]) -> list[float]:
        """``advance`` for a world of one robot, without arrays on the way.

        Returns:
            Joint angles, landmark coordinates and joint speeds.
        """
        puppet = self._puppets[0]
        puppet.command(command)
        self._simulate()
        return self._read_one(puppet)

    def reset_one(self, q: list[float]) -> list[float]:
        """``reset`` for a world of one robot, without arrays on the way.

        Returns:
            Joint angles, landmark coordinates and joint speeds.
        """
        puppet = self._puppets[0]
        puppet.reset(q)
        return self._read_one(puppet)

    def _simulate(self) -> None:
        """The bare physics of one control step."""
        step, substeps = self._bullet.stepSimulation, range(self.rates.substeps)
        for client in self._clients:
            for _ in substeps:
                step(client)

    def _read_one(self, puppet: _Puppet) -> list[float]:
        row = puppet.read()
        self._pending = row  # becomes arrays only if someone asks for them
        if self.self_collision:
            self.contacts = np.array([puppet.contacts()], dtype=np.int64)
        return row

    def close(self) -> None:
        """Disconnects; an unclosed client costs 28 MB."""
        clients, self._clients, self._puppets = self._clients, [], []
        for client in clients:
            if self._bullet.isConnected(client):
                self._bullet.disconnect(client)

    def __del__(self) -> None:
        if getattr(self, "_clients", None):
            self.close()

    def __getstate__(self) -> dict[str, Any]:
        # A live client id means nothing in another process.
        raise TypeError("a World holds live PyBullet clients and cannot be pickled; pickle the environment instead")


class _Puppet:
    """One robot in one client."""

    def __init__(self, robot: Robot, rates: Rates, client: int, self_collision: bool, plain: PlainBody) -> None:
        import pybullet

        self._bullet = pybullet
        self._client = client
        flags = pybullet.URDF_USE_SELF_COLLISION if self_collision else 0
        if plain.xml:
            flags |= pybullet.URDF_USE_INERTIA_FROM_FILE
        try:
            with plain.file(robot.urdf) as path, quiet(robot.name):
                body = pybullet.loadURDF(path, useFixedBase=True, flags=flags, physicsClientId=client)
        except pybullet.error as error:
            raise EmbodimentError(f"PyBullet cannot load {robot.urdf}: {error}; check the file") from error
        self._body: int = body
        rows = [
            pybullet.getJointInfo(body, joint, physicsClientId=client)
            for joint in range(pybullet.getNumJoints(body, physicsClientId=client))
        ]
        joints = {row[1].decode(): row[0] for row in rows}
        links = {row[12].decode(): row[0] for row in rows}
        links[pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()] = -1
        self._arms = _ids(joints, robot.joint_names, robot, "joint")
        self._movable = [row[0] for row in rows if row[2] in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC)]
        names = {row[0]: row[1].decode() for row in rows}
        self._rest = [float(robot.description.rest.get(names[joint], 0.0)) for joint in self._movable]
        self._arm_places = [self._movable.index(joint) for joint in self._arms]
        self._still = [[0.0]] * len(self._movable)
        self._points = _ids(links, plain.points, robot, "link")
        self.n_points = 3 * len(self._points)
        self._hands = _ids(links, plain.points[1::2], robot, "link")
        self._hand_masses = [pybullet.getDynamicsInfo(body, link, physicsClientId=client)[0] for link in self._hands]
        # A motor without a stated limit gets one that no arm will ever reach.
        self._effort = np.where(np.isfinite(robot.effort), robot.effort, _HOLD_FORCE)
        self._speed = np.where(np.isfinite(robot.speed), robot.speed, 1e3)
        self._gain = rates.motor_gain
        self._held = [joint for joint in self._movable if joint not in self._arms]
        self._conditions = NOMINAL
        if plain.torso is None:
            pybullet.setGravity(*(plain.gravity or _GRAVITY), physicsClientId=client)
        else:
            self._stand_up(links[plain.torso])
        self._filter(robot, links, self_collision, plain)
        self._hold()
        self._apply(NOMINAL)
        self._pristine: int | None = None
        # What Bullet gives a fixed base and moving links by itself.
        self._filters = [(-1, _FIXED), *((row[0], _MOVING) for row in rows)]

    def remember(self) -> None:
        """Keeps the present state of the client to return to at every reset."""
        self._pristine = self._bullet.saveState(physicsClientId=self._client)

    def reset(self, angles: Sequence[float]) -> None:
        """At rest at the given arm angles; every joint is set, since a partial reset leaves traces in the bits."""
        if self._pristine is not None:  # contacts remember the past
            self._bullet.restoreState(self._pristine, physicsClientId=self._client)
        q = [[angle] for angle in self._rest]
        for place, angle in zip(self._arm_places, angles, strict=True):
            q[place] = [angle]
        self._bullet.resetJointStatesMultiDof(self._body, self._movable, q, self._still, physicsClientId=self._client)
        if self._pristine is not None:
            self._forget_contacts()

    def _forget_contacts(self) -> None:
        """Takes every link out of the collision world and back in.

        ``restoreState`` brings back positions, but Bullet keeps what it learned about pairs of links that came near:
        contact points with their impulses and the axis that separated them last, and starts its solver from those. A
        link that leaves takes its pairs along. Made again in the same order, they give the bits of a fresh client.
        """
        nothing = [(link, (0, 0)) for link, _ in self._filters]
        for link, own in (*nothing, *self._filters):
            self._bullet.setCollisionFilterGroupMask(self._body, link, *own, physicsClientId=self._client)

    def command(self, targets: list[float]) -> None:
        """Position targets of the arm joints [rad]."""
        self._bullet.setJointMotorControlArray(
            self._body,
            self._arms,
            self._bullet.POSITION_CONTROL,
            targetPositions=targets,
            forces=self._forces,
            positionGains=self._gains,
            physicsClientId=self._client,
        )

    def read(self) -> list[float]:
        """Arm angles, coordinates of the landmarks, arm speeds; in one list."""
        states = self._bullet.getJointStates(self._body, self._arms, self._client)
        row = [state[0] for state in states]
        # Without forward kinematics PyBullet returns the link poses of the step before.
        for link in self._bullet.getLinkStates(self._body, self._points, 0, 1, self._client):
            row += link[4]
        row += [state[1] for state in states]
        return row

    def contacts(self) -> int:
        """Number of pairs of links that touch."""
        points = self._bullet.getContactPoints(self._body, self._body, physicsClientId=self._client)
        return len({(point[3], point[4]) for point in points if point[8] <= 0.0})

    def set_conditions(self, conditions: MotorConditions) -> None:
        """Changes motors and payload if they differ from the present ones."""
        if conditions != self._conditions:
            self._apply(conditions)

    def _apply(self, conditions: MotorConditions) -> None:
        self._conditions = conditions
        self._forces = (self._effort * (1.0 - conditions.friction)).tolist()
        self._gains = [self._gain * conditions.gain] * len(self._arms)
        # setJointMotorControlArray has no speed limit, but keeps the one set here.
        for joint, force, speed in zip(self._arms, self._forces, self._speed * conditions.speed, strict=True):
            self._bullet.setJointMotorControl2(
                self._body,
                joint,
                self._bullet.POSITION_CONTROL,
                targetPosition=0.0,
                positionGain=self._gains[0],
                force=force,
                maxVelocity=float(speed),
                physicsClientId=self._client,
            )
        for link, mass in zip(self._hands, self._hand_masses, strict=True):
            self._bullet.changeDynamics(self._body, link, mass=mass + conditions.payload, physicsClientId=self._client)

    def _stand_up(self, torso: int) -> None:
        """Moves the base so that the torso frame is the world frame when the legs are at rest."""
        bullet, client = self._bullet, self._client
        for joint, angle in zip(self._movable, self._rest, strict=True):
            bullet.resetJointState(self._body, joint, angle, physicsClientId=client)
        base = bullet.getBasePositionAndOrientation(self._body, physicsClientId=client)
        place = base
        if torso >= 0:
            state = bullet.getLinkState(self._body, torso, computeForwardKinematics=1, physicsClientId=client)
            place = (state[4], state[5])
        inverse = bullet.invertTransform(*place)
        self._turn = inverse[1]
        bullet.resetBasePositionAndOrientation(
            self._body, *bullet.multiplyTransforms(*inverse, *base), physicsClientId=client
        )
        down = bullet.rotateVector(self._turn, _GRAVITY)
        bullet.setGravity(*down, physicsClientId=client)

    def _filter(self, robot: Robot, links: dict[str, int], self_collision: bool, plain: PlainBody) -> None:
        if self_collision:
            for first, second in disabled_pairs(robot, plain):
                pair = _ids(links, (first, second), robot, "link")
                self._part(*pair)
            if plain.xml:
                self._part_what_touches_at_rest(robot, links)
            return
        for link in links.values():
            self._bullet.setCollisionFilterGroupMask(self._body, link, 0, 0, physicsClientId=self._client)

    def _part(self, first: int, second: int) -> None:
        self._bullet.setCollisionFilterPair(self._body, self._body, first, second, 0, physicsClientId=self._client)

    def _part_what_touches_at_rest(self, robot: Robot, links: dict[str, int]) -> None:
        """Coarse shapes may overlap at rest; such a contact would throw the arms about and says nothing."""
        bullet, client = self._bullet, self._client
        for joint, angle in zip(self._arms, robot.rest.tolist(), strict=True):
            bullet.resetJointState(self._body, joint, angle, physicsClientId=client)
        bullet.performCollisionDetection(physicsClientId=client)
        points = bullet.getContactPoints(self._body, self._body, physicsClientId=client)
        pairs = sorted({(point[3], point[4]) for point in points if point[8] <= 0.0})
        names = {number: name for name, number in links.items()}
        for pair in pairs:
            self._part(*pair)
        if pairs and robot.name not in _told:
            _told.add(robot.name)
            told = ", ".join(f"{names[a]} and {names[b]}" for a, b in pairs)
            _logger.warning("%s: these links touch at rest, so their contact does not count: %s", robot.name, told)

    def _hold(self) -> None:
        angles = dict(zip(self._movable, self._rest, strict=True))
        for joint in self._held:
            self._bullet.setJointMotorControl2(
                self._body,
                joint,
                self._bullet.POSITION_CONTROL,
                targetPosition=angles[joint],
                positionGain=1.0,
                force=_HOLD_FORCE,
                physicsClientId=self._client,
            )


def _connect(rates: Rates) -> int:
    import pybullet

    client: int = pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(rates.physics_dt, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(deterministicOverlappingPairs=1, physicsClientId=client)
    return client


def _ids(known: dict[str, int], names: Sequence[str], robot: Robot, what: str) -> list[int]:
    missing = [name for name in names if name not in known]
    if missing:
        raise EmbodimentError(f"{robot.urdf.name}: PyBullet knows no {what} {missing[0]!r}; it has {', '.join(known)}")
    return [known[name] for name in names]
