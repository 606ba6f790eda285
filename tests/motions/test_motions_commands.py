"""``syda-gym motions ...``: what a user sees."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.errors import MotionError
from syda_gym.motions import FORMATS, generate, load_motions, write_dataset
from tests.motions import recordings as rec

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")

run = CliRunner(env={"COLUMNS": "200"}).invoke


@pytest.fixture
def kinect(tmp_path: Path) -> Path:
    return rec.write_rows(tmp_path / "wave.csv", rec.kinect_rows(unit=100.0))


def test_info_says_units_axes_and_draws(kinect: Path, tmp_path: Path) -> None:
    result = run(app, ["motions", "info", str(kinect), "--picture", str(tmp_path / "wave.png")])
    assert result.exit_code == 0, result.output
    for words in (
        "40 frames",
        "30 frames per second",
        "centimetres",
        "+y is up",
        "operator",
        "upper arm",
        "[m/s]",
        "0.294",
    ):
        assert words in result.output
    assert (tmp_path / "wave.png").stat().st_size > 5000


def test_info_as_json(kinect: Path) -> None:
    result = run(app, ["motions", "info", str(kinect), "--json"])
    assert json.loads(result.output)["bodies"][0]["name"] == "operator"


def test_convert_to_file_and_folder_and_check(kinect: Path, tmp_path: Path) -> None:
    result = run(
        app,
        ["motions", "convert", f"kinect:{kinect}", "-o", str(tmp_path / "a.npz"), "--fps", "10", "--operator", "adult"],
    )
    assert result.exit_code == 0, result.output
    converted = load_motions(tmp_path / "a.npz")
    assert list(converted.bodies) == ["adult"]
    assert converted.takes[0].fps == 10.0
    assert run(app, ["motions", "convert", str(tmp_path / "a.npz"), "--out", str(tmp_path / "set")]).exit_code == 0
    result = run(app, ["motions", "check", str(tmp_path / "set")])
    assert result.exit_code == 0
    assert "no take has two bodies" in result.output


def test_check_fails_on_errors(tmp_path: Path) -> None:
    folder = write_dataset(generate(["adult", "nao"], actions=["drum", "salute"], variants=1), tmp_path / "set")
    assert "0 errors, 0 warnings" in run(app, ["motions", "check", str(folder)]).output
    (folder / "takes" / "0001.csv").write_text("time\n0\n")
    result = run(app, ["motions", "check", str(folder)])
    assert result.exit_code == 1
    assert "0001.csv" in result.output


def test_formats_are_listed() -> None:
    result = run(app, ["motions", "formats"])
    assert all(f"{name}:" in result.output for name in FORMATS)


def test_unknown_file_is_one_clear_error() -> None:
    result = run(app, ["motions", "info", "no-such-file.csv"])
    assert isinstance(result.exception, MotionError)
    assert "no-such-file.csv" in str(result.exception)
