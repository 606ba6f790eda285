"""Films of live runs show the operator beside the robot."""

from __future__ import annotations

import time
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.look import OPERATOR, rgb
from syda_gym.teleoperation.outgoing.bullet import BulletSink


def orange(film: Path) -> int:
    """Pixels of the film's last picture in the colour of the operator's shirt, lit or in the shade."""
    reader = imageio_ffmpeg.read_frames(str(film))
    size = next(reader)["size"]
    picture = np.frombuffer(list(reader)[-1], np.uint8).reshape(size[1], size[0], 3).astype(float)
    shares = picture / np.maximum(picture.sum(axis=2, keepdims=True), 1.0)
    wanted = np.array(rgb(OPERATOR)) / sum(rgb(OPERATOR))
    return int((np.abs(shares - wanted).max(axis=2) < 0.05).sum())


def test_the_operator_stands_beside_the_robot(tmp_path: Path) -> None:
    adult, pepper = catalog.get("adult"), catalog.get("pepper")
    counts = []
    for operator in (adult, None):
        film = tmp_path / f"{operator is None}.mp4"
        sink = BulletSink(pepper, operator=operator, video=film, rate=10.0)
        sink.accompany(lambda: adult.standing() + 0.0)
        with sink:
            time.sleep(1.0)
        counts.append(orange(film))
    assert counts[0] > 1000
    assert counts[1] < 100
