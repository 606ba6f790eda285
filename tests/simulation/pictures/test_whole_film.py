"""A film that ffmpeg did not finish is an error, and nothing is left in its place."""

from __future__ import annotations

import imageio_ffmpeg
import numpy as np
import pytest

from syda_gym.errors import StorageError
from syda_gym.simulation.pictures.video import write_video

PICTURES = [np.full((32, 48, 3), value, dtype=np.uint8) for value in range(0, 200, 10)]


@pytest.mark.parametrize("left", [b"", b"\x00\x00\x00\x20ftypisom", "half"])
def test_half_a_film_is_an_error(tmp_path, monkeypatch, left):
    whole = write_video(tmp_path / "whole.mp4", PICTURES).read_bytes()
    content = whole[: len(whole) // 2] if left == "half" else left

    def full_disk(path, *_, **__):
        while True:
            try:
                yield
            except GeneratorExit:
                with open(path, "wb") as file:
                    file.write(content)  # ffmpeg ends without a word
                return

    monkeypatch.setattr(imageio_ffmpeg, "write_frames", full_disk)
    with pytest.raises(StorageError, match="no whole film"):
        write_video(tmp_path / "film.mp4", PICTURES)
    assert [path.name for path in tmp_path.iterdir()] == ["whole.mp4"]
