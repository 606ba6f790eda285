"""Pictures and films: figures stand where they should, and films can be opened."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from syda_gym.errors import OptionError, SydaError
from syda_gym.evaluation.drawing import draw, write_png
from syda_gym.evaluation.report.figures import Shape, Track, track
from syda_gym.simulation.pictures.video import write_video


def _ball(kind: str, size: tuple[float, ...], **place) -> Track:
    shape = Shape(kind, size, (1.0, 0.0, 0.0), position=(0.0, 0.0, 1.0), **place)
    return Track("ball", "robot", (shape,), np.zeros((1, 0, 3)), np.zeros((1, 0, 7)), 2.0)


def _red(image):
    return (image[..., 0].astype(int) - image[..., 1] > 60) & (image[..., 2] < 120)


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("sphere", (0.2,), np.pi * 0.2**2),
        # Seen from slightly above: the mantle's silhouette and half of the cap's ellipse, top and bottom.
        ("cylinder", (0.2, 0.6), 0.4 * 0.6 * np.cos(0.16) + np.pi * 0.2**2 * np.sin(0.16)),
        ("box", (0.3, 0.3, 0.3), 0.3 * (0.3 * np.cos(0.16) + 0.3 * np.sin(0.16))),
    ],
)
def test_solids_cover_the_area_that_geometry_says(kind, size, area):
    image = draw([_ball(kind, size)], 0, size=(480, 480), turn=0.0)
    scale = min(480 / (2.35 + 0.25), 480 / (1.35 + 0.4))  # pixels a metre, as in draw
    assert _red(image).sum() / scale**2 == pytest.approx(area, rel=0.04)


def test_the_nearer_solid_hides_the_other():
    red = Shape("sphere", (0.2,), (1.0, 0.0, 0.0), position=(0.5, 0.0, 1.0))
    blue = Shape("sphere", (0.2,), (0.0, 0.0, 1.0), position=(0.0, 0.0, 1.08))
    both = Track("two", "robot", (red, blue), np.zeros((1, 0, 3)), np.zeros((1, 0, 7)), 2.0)
    alone = Track("one", "robot", (red,), np.zeros((1, 0, 3)), np.zeros((1, 0, 7)), 2.0)
    seen, whole = (_red(draw([tracks], 0, turn=0.0)).sum() for tracks in (both, alone))
    assert seen == pytest.approx(whole, rel=0.01)  # but for the mixed pixels of the outline


def test_a_raised_arm_shows(embedded):
    take = next(take for take in embedded.takes if "wave" in take.action)
    tracks = [track(embedded.bodies[name], take.frames[name]) for name in ("adult", "pepper")]
    frames = [draw(tracks, frame, size=(320, 180), finer=1) for frame in (0, len(tracks[0]) // 2)]
    assert frames[0].shape == (180, 320, 3)
    assert (np.abs(frames[0].astype(int) - frames[1]).max(axis=2) > 25).sum() > 100
    assert np.array_equal(frames[0], draw(tracks, 0, size=(320, 180), finer=1))


def test_pictures_and_films_can_be_read_back(embedded, tmp_path):
    import imageio_ffmpeg

    take = embedded.takes[0]
    tracks = [track(embedded.bodies["pepper"], take.frames["pepper"])]
    images = [draw(tracks, frame, size=(160, 120), finer=1) for frame in range(5)]
    assert np.array_equal(np.asarray(Image.open(write_png(images[0], tmp_path / "a.png"))), images[0])
    film = write_video(tmp_path / "a.mp4", iter(images), 10.0)
    reader = imageio_ffmpeg.read_frames(str(film))
    about = next(reader)
    assert about["size"] == (160, 120)
    assert sum(1 for _ in reader) == 5


def test_a_film_that_cannot_be_written_is_an_error_and_leaves_no_file(embedded, tmp_path, monkeypatch):
    import imageio_ffmpeg

    def broken(*_, **__):
        raise OSError(28, "No space left on device")
        yield

    take = embedded.takes[0]
    image = draw([track(embedded.bodies["pepper"], take.frames["pepper"])], 0, size=(160, 120), finer=1)
    monkeypatch.setattr(imageio_ffmpeg, "write_frames", broken)
    with pytest.raises(SydaError):
        write_video(tmp_path / "a.mp4", iter([image]), 10.0)
    assert list(tmp_path.iterdir()) == []


def test_bad_input_is_named():
    with pytest.raises(OptionError, match="even size"):
        draw([_ball("sphere", (0.2,))], 0, size=(101, 100))
    with pytest.raises(OptionError, match="at least one body"):
        draw([], 0)


@pytest.mark.parametrize(("ground", "low", "high"), [("day", 190, 256), ("night", 0, 80), ("dusk", 70, 150)])
def test_grounds_for_light_and_dark_pages_and_for_both(ground, low, high):
    """A film of the dusk is neither a white slab on a dark page nor a black one on a light page."""
    ball = Track("", "robot", (Shape("sphere", (0.1,), (1.0, 0.0, 0.0)),), np.zeros((1, 0, 3)), np.zeros((1, 0, 7)), 1)
    image = draw([ball], 0, labels=[""], size=(96, 64), ground=ground)
    corners = image[[0, 0, -1, -1], [0, -1, 0, -1]].mean(axis=1)
    assert (corners >= low).all()
    assert (corners < high).all()


def test_an_unknown_ground_is_refused():
    with pytest.raises(OptionError, match="unknown ground 'dask'; did you mean 'dusk'"):
        draw([_ball("sphere", (0.2,))], 0, ground="dask")
