"""Scripts: what each robot of a fleet will see and be asked for, step by step, until its episode ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.task.disturbances import Disturbances, Drawn, deliver, freeze_elbow_yaw, see, warm_up
from syda_gym.envs.task.dynamics import motor_plan
from syda_gym.envs.task.observation import MAX_AGE
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.task.repertoire import Repertoire
from syda_gym.simulation.motor_plan import MotorPlan

__all__ = ["Scripts"]

Rows = NDArray[np.intp]


class Scripts:
    """Tables of operator frames, base commands, ages and targets, and where each robot reads in them.

    Without disturbances all robots read the repertoire's own tables; with them, each robot has a page of its own that
    is written when its episode begins.

    Args:
        repertoire: clips and routes.
        options: of the environment.
        count: number of robots.

    Attributes:
        lengths: frames of each clip.
    """

    def __init__(self, repertoire: Repertoire, options: TeleopOptions, count: int) -> None:
        self._repertoire = repertoire
        self._preview = options.preview
        self._dt = options.rates.dt
        self._disturbances: Disturbances | None = options.disturbed
        self.lengths = np.array([clip.length for clip in repertoire.clips], dtype=np.intp)
        self._firsts = np.array([clip.first for clip in repertoire.clips], dtype=np.intp)
        self._freeze = 0.0 if self._disturbances is None else self._disturbances.freeze_elbow_yaw
        self._target_rows = repertoire.target_rows(self._freeze)
        self._target_at = np.zeros(count, dtype=np.intp)
        self._base_at = np.zeros(count, dtype=np.intp)
        self._operator_at = np.zeros(count, dtype=np.intp)
        self._known_routes: list[int] = []
        self._reader = (0, 0, 0)
        n = len(repertoire.robot.joint_names)
        width = (self._preview + 1) * n
        if self._disturbances is None:
            self._page = 0
            self._operator_rows = repertoire.operator_rows
            self._base_rows = np.zeros((0, width))
            self._ages = np.zeros(count)
        else:
            self._disturbances.check_operator(repertoire.operator)
            self._page = repertoire.longest + 1
            self._operator_rows = np.zeros((count * self._page, repertoire.operator.n_features))
            self._base_rows = np.zeros((count * self._page, width))
            self._age_rows = np.zeros(count * self._page)
            self._base_at = self._operator_at = np.arange(count, dtype=np.intp) * self._page

    def write(self, index: int, clip: int, frame: int, route: int, rng: np.random.Generator) -> MotorPlan | None:
        """Prepares one robot's episode.

        Args:
            index: of the robot.
            clip: index of the clip.
            frame: first frame.
            route: index of the route.
            rng: random numbers of the disturbances.

        Returns:
            The robot's motors and payload over the episode, ``None`` if nothing is disturbed.
        """
        first = self._firsts[clip]
        self._target_at[index] = first
        if self._disturbances is None:
            self._operator_at[index] = first
            self._base_at[index] = first + self._route_offset(route)
            return None
        drawn = self._disturbances.draw(rng)
        self._write_page(index, clip, frame, route, drawn, rng)
        return motor_plan(self._disturbances, drawn, int(self.lengths[clip]) - frame, self._dt)

    def draw_route(self, share: float) -> int:
        """A planned route, drawn in proportion to transferability, for a share in [0, 1)."""
        weights = np.nan_to_num([route.transferability for route in self._repertoire.routes], nan=0.0)
        if weights.sum() <= 0.0:
            weights = np.ones(len(weights))
        edges = np.cumsum(weights) / weights.sum()
        return min(int(np.searchsorted(edges, share, side="right")), len(edges) - 1)

    def base(self, which: Rows, k: Rows) -> FloatArray:
        """Base commands of some robots at steps ``k`` with their preview, ``(k, (preview + 1) n)``."""
        return np.asarray(self._base_rows[self._base_at[which] + k])

    def target(self, which: Rows, k: Rows) -> FloatArray:
        """What some robots should do at steps ``k``: joint angles and landmark coordinates."""
        return np.asarray(self._target_rows[self._target_at[which] + k])

    def base_of_all(self, k: Rows) -> FloatArray:
        """``base`` for every robot."""
        return np.asarray(self._base_rows[self._base_at + k])

    def target_of_all(self, k: Rows) -> FloatArray:
        """``target`` for every robot."""
        return np.asarray(self._target_rows[self._target_at + k])

    def operator_of_all(self, k: Rows) -> FloatArray:
        """Operator frames of the newest packets, ``(B, F)``."""
        return np.asarray(self._operator_rows[self._operator_at + k])

    def age_of_all(self, k: Rows) -> FloatArray:
        """Ages of the newest packets, ``(B,)`` [s]."""
        return self._ages if self._disturbances is None else np.asarray(self._age_rows[self._base_at + k])

    def turn_to(self, index: int) -> None:
        """Chooses the robot that the methods for single rows read for."""
        self._reader = (int(self._operator_at[index]), int(self._base_at[index]), int(self._target_at[index]))

    def operator_row(self, k: int) -> FloatArray:
        """Operator frame of the newest packet, ``(F,)``."""
        row: FloatArray = self._operator_rows[self._reader[0] + k]
        return row

    def base_row(self, k: int) -> FloatArray:
        """Base commands with their preview, ``((preview + 1) n,)``; a copy that the caller may hand out."""
        row: FloatArray = self._base_rows[self._reader[1] + k].copy()
        return row

    def target_row(self, k: int) -> FloatArray:
        """What the robot should do: joint angles and landmark coordinates; a copy that the caller may hand out."""
        row: FloatArray = self._target_rows[self._reader[2] + k].copy()
        return row

    def age(self, k: int) -> float:
        """Age of the newest packet [s]."""
        return 0.0 if self._disturbances is None else float(self._age_rows[self._reader[1] + k])

    def _route_offset(self, route: int) -> int:
        """Row at which the base commands of a route begin; they are appended when the route is first taken."""
        rows = len(self._repertoire.operator_rows)
        if route not in self._known_routes:
            mapped = self._repertoire.mapped_rows(route)
            pages = [
                self._repertoire.base_with_preview(mapped[clip.rows], np.arange(clip.length + 1), self._preview)
                for clip in self._repertoire.clips
            ]
            self._base_rows = np.vstack([self._base_rows, *pages])
            self._known_routes.append(route)
        return rows * self._known_routes.index(route)

    def _write_page(
        self, index: int, clip: int, frame: int, route: int, drawn: Drawn, rng: np.random.Generator
    ) -> None:
        repertoire, length, robot = self._repertoire, int(self.lengths[clip]), self._repertoire.robot
        first = frame - warm_up(drawn, self._dt)
        packets = np.arange(first, length + 1)
        rows = self._firsts[clip] + np.clip(packets, 0, length)
        seen = see(drawn, repertoire.operator, repertoire.operator_rows[rows], rng)
        mapped = freeze_elbow_yaw(robot, repertoire.map(route, seen), drawn.freeze_elbow_yaw)
        newest = deliver(drawn, first, length, frame, self._dt, rng)
        page = slice(index * self._page + frame, index * self._page + length + 1)
        self._operator_rows[page] = seen[newest - first]
        self._base_rows[page] = repertoire.base_with_preview(mapped, newest - first, self._preview)
        self._age_rows[page] = np.minimum((np.arange(frame, length + 1) - newest) * self._dt, MAX_AGE)
