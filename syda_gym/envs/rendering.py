"""Rendering: a fleet's robots as pictures, and a recorder of videos that needs no moviepy."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium

from syda_gym.envs.fleet import Fleet
from syda_gym.errors import OptionError
from syda_gym.simulation.pictures.camera import Camera, CameraView, Picture
from syda_gym.simulation.pictures.video import write_video
from syda_gym.simulation.pictures.window import Window

__all__ = ["Painter", "RecordVideo"]


class Painter:
    """Draws robots of a fleet; camera and window are made when they are first needed.

    Args:
        view: where the camera stands and what it shows.
    """

    def __init__(self, view: CameraView) -> None:
        self._view = view
        self._camera: Camera | None = None
        self._window: Window | None = None

    def picture(self, fleet: Fleet, index: int = 0) -> Picture:
        """Robot ``index``: ``(height, width, 3)`` uint8."""
        if self._camera is None:
            self._camera = Camera(fleet.robot, fleet.repertoire.operator, self._view)
        return self._camera.picture(**fleet.pose(index))

    def show(self, fleet: Fleet) -> None:
        """Shows the first robot in a window."""
        if self._window is None:
            self._window = Window(fleet.robot, fleet.repertoire.operator, self._view, fleet.rates.control_hz)
        self._window.show(**fleet.pose(0))

    def close(self) -> None:
        """Closes camera and window; harmless when repeated."""
        for viewer in (self._camera, self._window):
            if viewer is not None:
                viewer.close()
        self._camera = self._window = None

    def __getstate__(self) -> dict[str, Any]:
        return {"_view": self._view, "_camera": None, "_window": None}


class RecordVideo(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Writes episodes as ``.mp4`` like ``gymnasium.wrappers.RecordVideo``, by imageio-ffmpeg instead of moviepy.

    Args:
        env: an environment with ``render_mode="rgb_array"``.
        video_folder: where the videos go.
        episode_trigger: which episodes to record, by number; all by default.
        name_prefix: files are called ``PREFIX-episode-NUMBER.mp4``.

    Raises:
        OptionError: the environment cannot be recorded.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        video_folder: str | os.PathLike[str],
        episode_trigger: Callable[[int], bool] | None = None,
        name_prefix: str = "teleop",
    ) -> None:
        super().__init__(env)
        if env.render_mode != "rgb_array":
            raise OptionError(
                f"render mode {env.render_mode!r} cannot be recorded; create the environment with "
                "render_mode='rgb_array'"
            )
        self.video_folder = Path(video_folder)
        self.videos: list[Path] = []
        self._trigger = episode_trigger or (lambda episode: True)
        self._prefix = name_prefix
        self._episode = -1
        self._pictures: list[Any] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode; one that has not ended is written as far as it went."""
        self._write()
        result = self.env.reset(seed=seed, options=options)
        self._episode += 1
        if self._trigger(self._episode):
            self._pictures = [self.env.render()]
        return result

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One step; at the end of the episode the video is written."""
        result = self.env.step(action)
        if self._pictures:
            self._pictures.append(self.env.render())
            if result[2] or result[3]:
                self._write()
        return result

    def close(self) -> None:
        """Writes what is left and closes the environment."""
        self._write()
        super().close()

    def _write(self) -> None:
        pictures, self._pictures = self._pictures, []
        if pictures:
            path = self.video_folder / f"{self._prefix}-episode-{self._episode}.mp4"
            fps = float(self.env.metadata.get("render_fps", 30))
            self.videos.append(write_video(path, pictures, fps))
