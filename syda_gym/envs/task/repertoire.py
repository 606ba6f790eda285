"""Repertoire: the clips that an environment replays, as flat tables that a step only has to look up.

A mapping works frame by frame, so what it asks for may jump: closed-form kinematics change their branch where an arm
passes beside the head. Base commands and mapped references therefore go through the causal speed limiter of
``mappings.limits``, clip by clip at the control rate; it leaves motions within the limits as they are.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments import catalog
from syda_gym.embodiments.catalog import is_robot_file
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.envs.task.disturbances import freeze_elbow_yaw
from syda_gym.envs.task.options import SUCCESS_ERRORS, TeleopOptions
from syda_gym.errors import EmbodimentError, MappingError, MotionError, OptionError, RouteError, nearest_name
from syda_gym.mappings.limits import limit_speed, step_towards
from syda_gym.motions.clip import MotionClip, Motions, Take
from syda_gym.motions.loading import load_motions, resampled
from syda_gym.routes.piloting.pilot import Pilot, PlannedRoute

__all__ = ["ClipEntry", "Repertoire"]


@dataclass(frozen=True)
class ClipEntry:
    """One clip: its name (recording, ``~mirror`` for the mirrored half), action, first row and number of frames."""

    name: str
    action: str
    first: int
    length: int

    @property
    def rows(self) -> slice:
        """Its rows in the tables, the repeated last one included."""
        return slice(self.first, self.first + self.length + 1)


class Repertoire:
    """Clips at the control rate, with base commands of every planned route.

    Every clip has one row more than frames; the last row repeats the last frame, for the observation after the end.

    Attributes:
        operator: who leads.
        robot: who follows.
        clips: the clips.
        routes: the routes that an episode may take.
        clip_routes: index of the route that each clip takes unless the caller says otherwise.
        operator_rows: ``(rows, F)`` operator frames.
        success_error: mean landmark error of a successful episode [m].
    """

    def __init__(self, options: TeleopOptions) -> None:
        motions = load_motions(options.motions, options.fps)
        self.operator = _body(motions, options.operator, "operator")
        robot = _body(motions, options.robot, "robot", needed=options.reference == "paired")
        paired = options.reference == "paired" or (
            options.reference == "auto" and _together(motions, self.operator.name, robot.name)
        )
        if not isinstance(robot, Robot):
            raise EmbodimentError(f"robot={robot.name!r} is a {robot.kind}; choose a robot such as 'pepper'")
        self.robot = robot
        self._control_hz = float(options.control_hz)
        source, target = _clips(motions, options, self.operator.name, robot.name, paired)
        self.pilot = Pilot(
            motions,
            self.operator,
            robot,
            mapping=options.mapping,
            preset=options.preset,
            held_out=options.held_out,
            via=options.via,
            seed=options.fit_seed,
            predictor=options.predictor,
        )
        for notice in self.pilot.notices:
            warnings.warn(notice, UserWarning, stacklevel=2)
        self.routes: list[PlannedRoute] = list(self.pilot.plan(options.route))
        self.clips = _entries(source)
        self.clip_routes: list[int] = [0] * len(source)
        if options.route == "per_motion":
            self.clip_routes = self.pilot.for_clips(self.routes, [clip.frames for clip in source], self._control_hz)
        self.operator_rows = _padded([clip.frames for clip in source])
        self._mapped: dict[int, FloatArray] = {}
        self._targets: dict[float, FloatArray] = {}
        self.mapped_rows(0)  # now, so that a mapping that cannot be fitted says so at once
        self._paired_rows = _padded([clip.frames for clip in target]) if paired else None
        given = options.success_error
        self.success_error = SUCCESS_ERRORS["paired" if paired else "mapped"] if given is None else float(given)

    @property
    def longest(self) -> int:
        """Frames of the longest clip."""
        return max(clip.length for clip in self.clips)

    @property
    def names(self) -> list[str]:
        """Names of the clips."""
        return [clip.name for clip in self.clips]

    def mapped_rows(self, route: int) -> FloatArray:
        """What the mappings of a route make of each operator frame, ``(rows, n)`` [rad]; mapped on first use."""
        if route not in self._mapped:
            parts = [self.map(route, self.operator_rows[clip.rows]) for clip in self.clips]
            self._mapped[route] = np.concatenate(parts)
        return self._mapped[route]

    def target_rows(self, freeze: float = 0.0) -> FloatArray:
        """The reference of every frame, ``(rows, n + 6 * arms)``: joint angles [rad], landmark coordinates [m].

        Args:
            freeze: a mapped reference holds the joint that turns the elbow as ``disturbances.freeze_elbow_yaw`` does.
        """
        if freeze not in self._targets:
            q = self._reference_rows(freeze)
            self._targets[freeze] = np.hstack([q, self.robot.landmarks(q).reshape(len(q), -1)])
        return self._targets[freeze]

    def map(self, route: int, frames: FloatArray) -> FloatArray:
        """Operator frames ``(N, F)`` of one clip at the control rate to joint angles ``(N, n)`` [rad] along a route.

        Frames are taken in time order (``Mapping.follow``): within the joint limits, and those joints that follow limbs
        within their speeds.
        """
        mapping = self.pilot.mapping(self.routes[route].bodies)
        if mapping.window:
            raise MappingError(
                f"{mapping!r} looks at {mapping.window} past frames; the environment maps single frames: fit without "
                "window, or use mapping.stream.FrameStream in a loop of your own"
            )
        return self.robot.clamp(mapping.follow(frames, mapping.begin(), 1.0 / self._control_hz)[0])

    def limited(self, commands: FloatArray) -> FloatArray:
        """Commands at the control rate, ``(N, n)`` or ``(B, N, n)`` [rad], within the joint speed limits."""
        return limit_speed(self.robot, commands, self._control_hz)

    def base_with_preview(self, mapped: FloatArray, newest: NDArray[np.intp], preview: int) -> FloatArray:
        """Base commands of one episode, with those that follow if one more frame arrives at every step.

        Args:
            mapped: what the mapping makes of each frame, ``(N, n)`` [rad].
            newest: the newest frame at hand at each step, ``(steps,)``.
            preview: steps to look ahead.

        Returns:
            ``(steps, (preview + 1) n)`` [rad].
        """
        columns = [self.limited(mapped[newest])]
        for ahead in range(1, preview + 1):
            goal = mapped[np.minimum(newest + ahead, len(mapped) - 1)]
            columns.append(step_towards(self.robot, columns[-1], goal, self._control_hz))
        return np.hstack(columns)

    def clip_index(self, which: int | str) -> int:
        """Index of a clip by index or name.

        Raises:
            OptionError: no such clip.
        """
        return _clip_index(self.names, which)

    def route_index(self, bodies: str | Sequence[str]) -> int:
        """Index of a route, planned now if it was not yet; ``"auto"`` is the first one.

        Raises:
            RouteError: the route cannot be taken.
        """
        if isinstance(bodies, str):
            if bodies != "auto":
                raise RouteError(f"route must be 'auto' or names of bodies, got {bodies!r}")
            return 0
        known = [route.bodies for route in self.routes]
        if tuple(bodies) not in known:
            self.routes += self.pilot.plan(tuple(bodies))
            return len(self.routes) - 1
        return known.index(tuple(bodies))

    def _reference_rows(self, freeze: float) -> FloatArray:
        if self._paired_rows is not None:
            return self._paired_rows
        q = self.mapped_rows(0).copy()
        for clip in self.clips:
            q[clip.rows] = self.limited(freeze_elbow_yaw(self.robot, q[clip.rows], freeze))
        return q


def _body(motions: Motions, body: object, what: str, *, needed: bool = True) -> Embodiment:
    if not isinstance(body, Embodiment) and str(body) not in motions.bodies and is_robot_file(body):
        body = catalog.resolve(str(body))
    name = body.name if isinstance(body, Embodiment) else str(body)
    if name in motions.bodies:
        found = motions.bodies[name]
        if isinstance(body, Embodiment) and body != found:
            raise EmbodimentError(f"{what} {name!r} differs from the body of that name in {motions.name}")
        return found
    if needed and what == "robot" and (isinstance(body, Embodiment) or name in catalog.names()):
        raise EmbodimentError(
            f"robot={name!r}: {motions.name} has no motion of it; pass reference='mapped' to track what the mapping "
            "makes of the operator"
        )
    if needed:
        raise EmbodimentError(
            f"{what}={name!r}: {motions.name} has no motion of it; {nearest_name(name, motions.bodies)}"
            + (". With reference='mapped' the robot needs no motion of its own" if what == "robot" else "")
        )
    return catalog.resolve(body)  # type: ignore[arg-type]


def _together(motions: Motions, operator: str, robot: str) -> bool:
    return any(operator in take.frames and robot in take.frames for take in motions.takes)


def _clips(
    motions: Motions, options: TeleopOptions, operator: str, robot: str, paired: bool
) -> tuple[list[MotionClip], list[MotionClip]]:
    """The chosen clips of operator and robot at the control rate; of the robot none if it has no reference motion."""
    bodies = [operator, robot] if paired else [operator]
    takes = [take for take in motions.takes if all(body in take.frames for body in bodies)]
    if not takes:
        raise MotionError(
            f"{motions.name}: {operator!r} and {robot!r} were never recorded together; "
            "choose others or set reference='mapped'"
        )
    takes = _chosen(takes, options)
    used = replace(motions, takes=tuple(_only(take, bodies) for take in takes))
    used = resampled(used, float(options.control_hz))
    source = list(used.clips(operator))
    return source, list(used.clips(robot)) if paired else []


def _chosen(takes: list[Take], options: TeleopOptions) -> list[Take]:
    if options.actions is not None:
        known = {take.action for take in takes}
        for action in options.actions:
            if action not in known:
                raise OptionError(f"actions: unknown action {action!r}; {nearest_name(str(action), known)}")
        takes = [take for take in takes if take.action in set(options.actions)]
    if options.clips is not None:
        names = [_take_name(take) for take in takes]
        takes = [takes[_clip_index(names, which)] for which in options.clips]
    if not takes:
        raise OptionError("clips= and actions= leave nothing to play; name at least one")
    return takes


def _only(take: Take, bodies: list[str]) -> Take:
    return replace(take, frames={body: take.frames[body] for body in bodies}, filled={})


def _take_name(take: Take) -> str:
    return take.recording + ("~mirror" if take.mirrored else "")


def _clip_index(names: Sequence[str], which: int | str) -> int:
    if isinstance(which, str):
        if which not in names:
            raise OptionError(f"no clip {which!r}; {nearest_name(which, names)}")
        return names.index(which)
    if isinstance(which, bool) or not isinstance(which, int | np.integer) or not 0 <= which < len(names):
        raise OptionError(f"clips are numbered 0 to {len(names) - 1}, got {which!r}")
    return int(which)


def _entries(clips: list[MotionClip]) -> tuple[ClipEntry, ...]:
    entries, first = [], 0
    for clip in clips:
        name = clip.recording + ("~mirror" if clip.mirrored else "")
        entries.append(ClipEntry(name, clip.action, first, len(clip)))
        first += len(clip) + 1
    return tuple(entries)


def _padded(parts: list[FloatArray]) -> FloatArray:
    """Parts one below the other, each with its last row repeated."""
    return np.concatenate([row for part in parts for row in (part, part[-1:])])
