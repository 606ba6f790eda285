"""What a person says of a file means the same to every command that takes one."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syda_gym.cli.acting.scene import Scene
from syda_gym.cli.groups.reading import Reading
from syda_gym.cli.main import app
from syda_gym.embodiments import catalog
from syda_gym.errors import MotionError
from syda_gym.motions import HowToRead, Motions, generate, load_motions, save_motions
from syda_gym.teleoperation.addresses import make_source
from tests.motions import recordings as rec

JOINTS = ["LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand", "LHip", "RHip"]
SAID = [f"{name}=ch{3 * i},ch{3 * i + 1},{3 * i + 2}" for i, name in enumerate(JOINTS)]
OPTIONS = f"{' '.join(f'--joints {text}' for text in SAID)} --unit in --up z --fps 30"


def write(path: Path, action: str, count: int = 90) -> Path:
    """Columns that nobody can know, in inches."""
    _, joints = rec.moving_human(action, count)
    table = np.concatenate([joints[name] * 39.37 for name in JOINTS], axis=1)
    rows = [",".join(f"ch{i}" for i in range(24)), *(",".join(f"{value:.6f}" for value in row) for row in table)]
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    folder.mkdir()
    for action in ("wave_high", "drum"):
        write(folder / f"{action}.csv", action)
    return folder


@pytest.fixture
def layout(tmp_path: Path) -> Path:
    path = tmp_path / "lab.yaml"
    path.write_text(f"order: {JOINTS}\nunit: in\nup: z\nfps: 30\nskip_lines: 1\n")
    return path


def right(motions: Motions, action: str, body: str = "operator") -> None:
    """The limbs are those that were written."""
    clip = next(clip for clip in motions.clips(body) if clip.action == action)
    _, joints = rec.moving_human(action, 90)
    truth = np.stack([joints["LElbow"] - joints["LShoulder"], joints["LHand"] - joints["LElbow"]], axis=1)
    found = np.diff(clip.body.arm_points(clip.frames)[:, 0], axis=1)
    apart = len(truth) - len(found)  # pairing cuts where only one of both is there
    truth, found = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (truth, found))
    angles = [
        np.degrees(np.arccos(np.clip((truth[s : s + len(found)] * found).sum(-1), -1, 1))).max()
        for s in range(apart + 1)
    ]
    assert min(angles) < 2.0
    assert clip.fps == 30.0
    assert clip.body.reach == pytest.approx(0.581, abs=0.01)


def run(command: str) -> str:
    done = CliRunner(env={"COLUMNS": "400"}).invoke(app, shlex.split(command), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_without_it_nothing_is_read(lab: Path) -> None:
    with pytest.raises(MotionError, match="24 columns called ch0"):
        load_motions(lab / "drum.csv")


@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")
def test_one_by_one_and_by_layout_in_every_command(lab: Path, layout: Path, tmp_path: Path) -> None:
    for way, said in enumerate((OPTIONS, f"--layout {layout}")):
        assert "operator" in run(f"motions info {lab}/drum.csv {said}")
        run(f"motions convert {lab}/drum.csv {said} --out {tmp_path}/{way}.npz")
        right(load_motions(tmp_path / f"{way}.npz"), "drum")
        shown = run(f"motions pair {lab} embedded {said} --out {tmp_path}/pairs{way}")
        assert "left out" not in shown
        pairs = load_motions(tmp_path / f"pairs{way}")
        for action in ("wave_high", "drum"):
            right(pairs, action)
        shown = run(f"teleop --method geometric --source replay:{lab}/drum.csv {said} --sink none --calibration 0")
        acted = re.search(r"commands for (\d+) frames", shown)
        assert acted is not None, shown
        assert int(acted[1]) > 45  # of 90; a busy machine takes the newest


@pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")
def test_the_same_reaches_replays_environments_and_routes(lab: Path) -> None:
    reading = Reading(fps=30.0, joints=SAID, unit="in", up="z")
    source = make_source(f"replay:{lab / 'drum.csv'}", catalog.get("adult"), how=reading.how())
    right(load_motions(lab / "drum.csv", 30.0, joints=dict(t.split("=") for t in SAID), unit="in", up="z"), "drum")
    assert len(source.clips[0]) == 90  # type: ignore[attr-defined]
    scene = Scene(motions=str(lab / "wave_high.csv"), operator="operator", fps=30.0, joints=SAID, unit="in", up="z")
    right(scene.options()["motions"], "wave_high")
    assert Scene().options()["motions"] == "embedded"
    assert reading.read(str(lab / "drum.csv")).name.endswith("drum.csv")  # type: ignore[union-attr]


def test_what_is_said_is_listed() -> None:
    assert HowToRead().said == ()
    assert HowToRead(unit="mm", person=2).said == ("unit", "person")


def test_one_clock_keeps_its_times_beside_a_rate(tmp_path: Path) -> None:
    """`--fps` is the rate of the pairs; it must not take the times away by which both are aligned."""
    _, joints = rec.moving_human("drum", 90)
    names = ",".join(f"{name}_{axis}" for name in JOINTS for axis in "xyz")
    rows = [
        f"{5.0 + t / 30:.4f}," + ",".join(f"{value:.6f}" for name in JOINTS for value in joints[name][t])
        for t in range(90)
    ]
    (tmp_path / "drum.csv").write_text("\n".join([f"time,{names}", *rows]) + "\n")
    prompts = generate(["pepper"], actions=["drum"], variants=1)
    take = prompts.takes[0]
    clocked = replace(take, timestamps=5.2 + np.arange(len(take.frames["pepper"])) / 30.0)
    save_motions(replace(prompts, takes=(clocked,)), tmp_path / "prompts.npz")
    run(f"motions pair {tmp_path}/drum.csv {tmp_path}/prompts.npz --fps 20 --same-clock --out {tmp_path}/set")
    assert load_motions(tmp_path / "set").takes[0].fps == 20.0
