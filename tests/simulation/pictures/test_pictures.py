"""Pictures show what they should: robot, ghost, operator and error colours; videos play."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import EmbodimentError, OptionError
from syda_gym.simulation.pictures.camera import Camera, CameraView, error_color
from syda_gym.simulation.pictures.video import write_video
from syda_gym.simulation.pictures.window import Window, has_display

PEPPER, ADULT = catalog.get("pepper"), catalog.get("adult")
SMALL = {"width": 160, "height": 120}


def differ(one, two):
    """Pixels that differ by more than rounding, as a mask."""
    return (np.abs(one.astype(int) - two.astype(int)) > 2).any(axis=2)


@pytest.fixture(scope="module")
def camera():
    camera = Camera(PEPPER, ADULT, CameraView(**SMALL))
    yield camera
    camera.close()


def raised():
    q = PEPPER.rest.copy()
    q[0], q[5] = -0.8, -0.8
    return q


def test_a_picture_has_its_size_and_shows_motion_of_robot_ghost_and_operator(camera):
    plain = camera.picture(PEPPER.rest, operator=ADULT.standing())
    assert plain.shape == (120, 160, 3)
    assert plain.dtype == np.uint8
    moved = differ(plain, camera.picture(raised(), operator=ADULT.standing()))
    assert 20 < moved.sum() < 4000
    assert not moved[:, 80:].any(), "the operator's half must not change"
    ghost = camera.picture(PEPPER.rest, reference=raised(), operator=ADULT.standing())
    veil = differ(plain, ghost)
    assert veil.sum() > 20
    blue = ghost[veil].astype(int) - plain[veil].astype(int)
    assert blue[:, 2].mean() > blue[:, 0].mean() + 10, "the ghost is bluish"
    waving = ADULT.standing().reshape(2, 3, 3)
    waving[0, 1:, 1] = waving[0, 0, 1] + 0.3
    waved = differ(plain, camera.picture(PEPPER.rest, operator=waving.ravel()))
    assert waved.sum() > 10
    assert not waved[:, :80].any(), "the robot's half must not change"


@pytest.mark.parametrize(("ground", "low", "high"), [("night", 0, 75), ("dusk", 70, 150)])
def test_grounds_for_dark_pages_and_for_both_change_what_is_behind_alone(camera, ground, low, high):
    day = camera.picture(PEPPER.rest, operator=ADULT.standing())
    with Camera(PEPPER, ADULT, CameraView(**SMALL, ground=ground)) as other:
        picture = other.picture(PEPPER.rest, operator=ADULT.standing())
    corners = np.array([picture[row, column] for row in (0, -1) for column in (0, -1)]).mean(axis=1)
    assert (corners >= low).all()
    assert (corners < high).all()
    robot = (slice(35, 60), slice(54, 60))  # chest and head of Pepper
    assert not differ(day[robot], picture[robot]).all()
    assert differ(day, picture).mean() > 0.6
    assert day[:5].mean() > 200


def test_an_unknown_ground_is_refused():
    with pytest.raises(OptionError, match="ground='dask' is unknown; did you mean 'dusk'"):
        CameraView(ground="dask")


def test_the_same_pose_gives_the_same_picture(camera):
    first = camera.picture(raised(), reference=PEPPER.rest, operator=ADULT.standing(), errors=np.full(4, 0.1))
    camera.picture(PEPPER.rest, operator=ADULT.standing())
    again = camera.picture(raised(), reference=PEPPER.rest, operator=ADULT.standing(), errors=np.full(4, 0.1))
    assert (first == again).all()


@pytest.mark.parametrize("distance", [3.0, 1.2, 0.6])
def test_rendering_only_where_the_arms_are_cuts_nothing_off(distance):
    pose = {"reference": PEPPER.rest, "operator": ADULT.standing(), "errors": np.full(4, 0.1)}
    with Camera(PEPPER, ADULT, CameraView(**SMALL, distance=distance, yaw=30)) as camera:
        pictures = []
        for girth in (1e3, 0.15, 0.01):  # the whole picture, as usual, and far too little
            camera._girth = girth
            pictures.append(camera.picture(raised(), **pose))
        empty = camera._background
    shown = differ(pictures[0], empty).sum()
    assert shown > 50
    for picture in pictures[1:]:
        assert differ(pictures[0], picture).sum() <= 0.01 * shown, "edges may round differently, nothing else"


def test_errors_turn_from_green_to_red(camera):
    shares = [error_color(share) for share in (0.0, 0.5, 1.0)]
    assert shares[0][1] > shares[0][0]
    assert shares[2][0] > shares[2][1]
    plain = camera.picture(PEPPER.rest)
    good, bad = (camera.picture(PEPPER.rest, errors=np.full(4, error)) for error in (0.0, 0.5))
    changed = differ(good, bad)
    assert differ(plain, good).sum() > 10
    assert (bad[changed][:, 0].astype(int) > good[changed][:, 0]).mean() > 0.9


def test_the_view_decides_what_is_shown():
    with Camera(PEPPER, ADULT, CameraView(**SMALL, ghost=False, operator=False, error=False)) as bare:
        one = bare.picture(PEPPER.rest)
        two = bare.picture(PEPPER.rest, reference=raised(), operator=ADULT.standing(), errors=np.ones(4))
        assert (one == two).all()
    with Camera(PEPPER, catalog.get("nao"), CameraView(**SMALL)) as robots:
        nao = catalog.get("nao").rest
        moved = nao.copy()
        moved[0] -= 1.0
        assert differ(robots.picture(PEPPER.rest, operator=nao), robots.picture(PEPPER.rest, operator=moved)).any()


def test_another_appearance_can_be_shown_if_it_has_the_joints():
    with Camera(PEPPER, None, CameraView(**SMALL, appearance=str(PEPPER.urdf))) as camera:
        assert camera.picture(PEPPER.rest).std() > 10
    with pytest.raises(EmbodimentError, match=r"no URDF nowhere\.urdf"):
        Camera(PEPPER, None, CameraView(appearance="nowhere.urdf"))
    with pytest.raises(EmbodimentError, match="LShoulderPitch"):
        Camera(catalog.get("nao"), None, CameraView(appearance=_headless(PEPPER.urdf)))


def _headless(path):
    import tempfile

    text = path.read_text().replace("LShoulderPitch", "LShoulderPitchX")
    with tempfile.NamedTemporaryFile("w", suffix=".urdf", delete=False) as file:
        file.write(text)
    return file.name


@pytest.mark.parametrize("bad", [{"width": 0}, {"fov": 500}, {"distance": "far"}, {"wide": 1}, 3], ids=str)
def test_views_that_cannot_be_are_refused(bad):
    with pytest.raises(OptionError):
        CameraView.resolve(bad)


@pytest.mark.skipif(has_display(), reason="there is a display")
def test_without_a_display_a_window_says_so():
    with pytest.raises(OptionError, match="rgb_array"):
        Window(PEPPER, ADULT, CameraView(), 30.0)


def test_a_video_holds_its_frames(tmp_path):
    import imageio_ffmpeg

    pictures = [np.full((61, 81, 3), shade, dtype=np.uint8) for shade in (0, 80, 160, 240)]
    path = write_video(tmp_path / "clip.mp4", pictures, fps=10)
    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    frames = [np.frombuffer(frame, np.uint8).mean() for frame in reader]
    assert meta["size"] == (80, 60)
    np.testing.assert_allclose(frames, [0, 80, 160, 240], atol=4)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "pictures"),
    [
        ("x.gif", [np.zeros((4, 4, 3), np.uint8)]),
        ("x.mp4", []),
        ("x.mp4", [np.zeros((4, 4))]),
        ("x.mp4", [np.zeros((4, 4, 3), np.uint8), np.zeros((6, 4, 3), np.uint8)]),
    ],
    ids=["ending", "empty", "gray", "sizes"],
)
def test_what_is_no_video_is_refused_and_leaves_nothing(tmp_path, name, pictures):
    with pytest.raises(OptionError):
        write_video(tmp_path / name, pictures)
    assert list(tmp_path.iterdir()) == []
