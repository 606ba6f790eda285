"""Films of episodes: one camera after the other, several episodes a file as LeRobotDataset v3.0 keeps them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.embodiments.robot import Robot
from syda_gym.evaluation.data_sets.lerobot_format import VIDEOS, indices
from syda_gym.evaluation.data_sets.lerobot_statistics import Colours
from syda_gym.evaluation.data_sets.playing import Played
from syda_gym.simulation.pictures.camera import Camera, CameraView, Picture
from syda_gym.simulation.pictures.video import write_video

__all__ = ["CAMERAS", "film_episodes"]

_PLAIN = CameraView(ghost=False, error=False)  # a policy must not see where the robot should be
CAMERAS: Mapping[str, CameraView] = {
    "front": replace(_PLAIN, operator=False),
    "side": replace(_PLAIN, operator=False, yaw=65.0),
    "scene": _PLAIN,
}
"""Cameras by name: the robot alone from the front or from its left, or operator and robot side by side."""


def film_episodes(
    folder: Path,
    key: str,
    view: CameraView,
    episodes: Sequence[Played],
    robot: Robot,
    operator: Embodiment,
    fps: int,
) -> list[Colours]:
    """Films every episode by one camera; a picture shows what was there before the command of its row.

    Args:
        folder: of the data set.
        key: name of the camera's feature.
        view: where the camera stands.
        episodes: as they were played.
        robot: who followed.
        operator: who led.
        fps: pictures per second.

    Returns:
        The colours of each episode.
    """
    colours = [Colours() for _ in episodes]
    with Camera(robot, operator, view) as camera:

        def pictures(numbers: Sequence[int]) -> Iterator[Picture]:
            for number in numbers:
                episode, counted = episodes[number], Colours.worth_a_look(len(episodes[number]))
                for row in range(len(episode)):
                    picture = camera.picture(episode.q[row], operator=episode.operator[row])
                    if row in counted:
                        colours[number].look(picture)
                    yield picture

        for (chunk, file), numbers in groupby(range(len(episodes)), indices):
            path = folder / VIDEOS.format(video_key=key, chunk_index=chunk, file_index=file)
            # Two pictures to a key frame: loaders jump to single pictures.
            write_video(path, pictures(list(numbers)), fps=fps, key_frame_every=2)
    return colours
