"""A command that refuses leaves nothing behind, says the nearest name, and names the option that it refuses."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.errors import SydaError
from syda_gym.files import asset

REFUSED = [
    ("demo --motions embeded", "did you mean 'embedded'"),
    ("demo --motions papr:DIR", "did you mean 'paper'"),
    ("demo --robot peper", "did you mean 'pepper'"),
    ("demo --seed -1", "--seed"),
    ("demo --out a-file", "a-file is a file"),
    ("reproduce-paper --motions embeded", "did you mean 'embedded'"),
    ("reproduce-paper --motions embedded --method sida", "did you mean 'syda'"),
    ("reproduce-paper --motions embedded --method syda:genral", "did you mean 'general'"),
    ("reproduce-paper --motions embedded --protocol laoa", "did you mean 'loao'"),
    ("reproduce-paper --motions embedded --seeds 0", "--seeds"),
    ("reproduce-paper --motions embedded --workers 0", "--workers"),
    ("transferability adlt --picture a.png", "did you mean 'adult'"),
    ("transferability --definition papr", "did you mean 'paper'"),
    ("transferability --picture a.jpg", "--picture"),
    ("transferability --validate --folds 1", "--folds"),
    ("route --operator adlt --picture a.png", "did you mean 'adult'"),
    ("route --robot peper --pair adult:kid --picture a.png", "did you mean 'pepper'"),
    ("route --predictor coverge", "did you mean 'coverage'"),
    ("route --pair adult-kid", "--pair"),
    ("route --max-hops 0", "--max-hops"),
    ("train --config telop", "did you mean 'teleop'"),
    ("train --config missing.yaml", "no file missing.yaml"),
    ("train --config bad.yaml", "did you mean 'gamma'"),
    ("train --kind predicter", "did you mean 'predictor'"),
    ("train --algorithm pppo", "did you mean 'ppo'"),
    ("train --base kalmann", "did you mean 'kalman'"),
    ("train --held-out wave_hgh", "did you mean 'wave_high'"),
    ("train --disturbances teleop:nois:test", "did you mean 'noise'"),
    ("train --disturbances full", "did you mean 'teleop:full'"),
    ("train --method syda --preset papr", "did you mean 'paper'"),
    ("train --operator adlt", "did you mean 'adult'"),
    ("train --route adult,kd,pepper", "did you mean 'kid'"),
    ("train --resume", "no checkpoint"),
    ("tune kalmann", "did you mean 'kalman'"),
    ("tune kalman --budget 0", "--budget"),
    ("tune kalman --disturbances teleop:nois:train", "did you mean 'noise'"),
    ("evaluate kalmann", "did you mean 'kalman'"),
    ("play runs/missing", "no agent 'runs/missing'"),
    ("export runs/missing", "runs/missing"),
    ("evaluate lead --physics bulet", "did you mean 'bullet'"),
    ("evaluate lead --reference mappd", "did you mean 'mapped'"),
    ("evaluate lead --physics-hz 100", "--physics-hz"),
    ("evaluate lead --draws 0", "--draws"),
    ("play --clip wave_hgh-01", "did you mean 'wave_high-01'"),
    ("play --clip 5000", "clips are numbered 0 to"),
    ("play --out wave.avi", "must end in .mp4"),
    ("play --mapping sida", "did you mean 'syda'"),
    ("export adult-peper-full", "did you mean 'adult-pepper-full'"),
    ("export base", "has no file"),
    ("export adult-pepper-full --out graph", "must end in .onnx"),
    ("export adult-pepper-full --mapping nowhere.json", "nowhere.json"),
    ("teleop --source udpp:9870", "did you mean 'udp'"),
    ("teleop --sink vidio:a.mp4", "did you mean 'video'"),
    ("teleop --method geometric --sink video:a.avi --journal run.jsonl", "a.avi"),
    ("teleop --method geometric --action wave_hgh --sink none --journal run.jsonl", "did you mean 'wave_high'"),
    ("teleop --journal run.txt", "--journal"),
    ("journal export nowhere.jsonl", "nowhere.jsonl"),
    ("teleop --axes kinekt", "did you mean 'kinect'"),
    ("teleop --limit 2", "--limit"),
    ("teleop --rate 0", "--rate"),
    ("teleop --speed 0", "--speed"),
    ("teleop --calibration -1", "--calibration"),
    ("teleop --robot adult", "'adult' is a human"),
    ("teleop --robot peper", "did you mean 'pepper'"),
    ("record --out set --action wave_hgh", "did you mean 'wave_high'"),
    ("record --out set --robot adult", "'adult' is a human"),
    ("record --out set --sink bulet", "did you mean 'bullet'"),
    ("record --out set --takes 0", "--takes"),
    ("record --countdown -1", "--countdown"),
    ("fit no-such-folder", "no-such-folder"),
    ("fit --operator adult", "--robot"),
    ("fit --method rigde", "did you mean 'ridge'"),
    ("benchmark missing.yaml", "no benchmark configuration"),
    ("benchmark bad.yaml", "gamm"),
    ("benchmark --workers 0", "--workers"),
    ("benchmark --workers rai", "--workers"),
    ("benchmark --motions embeded", "did you mean 'embedded'"),
    ("compare a b", "benchmark.json is missing"),
    ("compare a b --figure landmark", "did you mean 'landmark_error'"),
    ("suggest adlt kid", "did you mean 'adult'"),
    ("suggest adult kid --benchmark nowhere", "benchmark.json is missing"),
    ("suggest --count 0", "--count"),
    ("export-episodes a/b-v0 --route adult,pepper --robot nao", "does not lead from adult to nao"),
    ("export-episodes a/b-v0 --route auto", "--route"),
    ("export-episodes a/b-v0 --agent kalmann", "did you mean 'kalman'"),
    ("export-episodes a/b-v0 --disturbances teleop:full:tst", "did you mean 'test'"),
    ("robot add missing.urdf", "missing.urdf"),
    ("robot add bad.yaml", "bad"),
    ("robot add nao.urdf --name pepper", "is taken"),
    ("robot add nao.urdf --name mine --left LArmm", "LArmm"),
    ("robot show peper", "did you mean 'pepper'"),
    ("robot show adult", "is a human"),
    ("robot show nao --picture nao.jpg", "--picture"),
    ("motions info embeded --picture a.png", "did you mean 'embedded'"),
    ("motions info bad.yml", "did you mean 'bad.yaml'"),
    ("motions check nowhere", "nowhere"),
    ("motions convert embeded --out a.npz", "did you mean 'embedded'"),
    ("motions convert embedded --out a.bvh", "must end in .npz"),
    ("motions convert embedded --out a.npz --fps 0", "--fps"),
    ("motions convert embedded --out a.npz --fps nan", "--fps"),
    ("motions convert embedded --out a.npz --operator adlt", "did you mean 'adult'"),
    ("motions pair nowhere embedded --out set", "nowhere"),
    ("motions pair embedded embedded --out set --robot peper", "did you mean 'pepper'"),
    ("motions pair embedded embedded --out set --max-lag 0", "--max-lag"),
    ("motions pair lab embedded --out set --joints LShoulder", "--joints"),
    ("motions pair lab embedded --out set --joints LeftElbow=a", "did you mean 'LElbow'"),
    ("motions pair lab.csv embedded --out set --unit furlong", "unit: expected one of"),
    ("motions pair lab.csv embedded --out set --up sideways", "up: expected an axis"),
    ("motions pair lab.csv embedded --out set --layout missing.yaml", "missing.yaml"),
    ("motions pair embedded embedded --out set --unit mm", "these motions know their own"),
    ("motions info embedded --person 0", "--person"),
    ("teleop --method geometric --sink none --source replay:lab.csv --unit furlong", "unit: expected one of"),
    ("teleop --method geometric --sink none --source replay:lab.csv --layout bad.yaml", "unknown key 'gamm'"),
    ("teleop --method geometric --sink none --source replay:embedded --person 2", "these motions know their own"),
    ("teleop --method geometric --sink none --source camera --unit mm --up z", "unit, up said of 'camera'"),
    ("teleop --method geometric --sink none --source udp:9870 --fps 30", "only recordings need that"),
    ("play --motions lab.csv --operator operator --unit furlong", "unit: expected one of"),
    ("evaluate lead --motions embedded --joints LShoulder=a", "these motions know their own"),
    ("transferability adult --motions lab.csv --up sideways", "up: expected an axis"),
    ("route --motions lab.csv --unit furlong", "unit: expected one of"),
    ("demmo", "Did you mean 'demo'"),
    ("motions chek", "Did you mean 'check'"),
    ("play --metod syda", "--method"),
]
"""A command that must refuse, and words that it must say."""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "place"
    folder.mkdir()
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    monkeypatch.chdir(folder)
    (folder / "a-file").write_text("here")
    (folder / "bad.yaml").write_text("gamm: 0.5\n")
    (folder / "lab.csv").write_text("time,a,b,c\n0,1,2,3\n1,2,3,4\n")
    (folder / "nao.urdf").write_bytes(asset("robots", "nao.urdf").read_bytes())
    return folder


def listing(folder: Path) -> dict[str, bytes | None]:
    """Everything in a folder, files with their content."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


@pytest.mark.parametrize(("command", "words"), REFUSED, ids=[command for command, _ in REFUSED])
def test_a_refusal_leaves_nothing_and_says_what_was_meant(command, words, place: Path, tmp_path: Path):
    before = listing(place)
    done = CliRunner(env={"COLUMNS": "4000", "TERMINAL_WIDTH": "4000"}).invoke(app, shlex.split(command))
    assert done.exit_code != 0
    assert isinstance(done.exception, SydaError | SystemExit), repr(done.exception)
    assert words in f"{done.output}{done.exception}"
    assert listing(place) == before
    assert not (tmp_path / "home" / "robots").exists()


def test_every_command_is_refused_above():
    program = typer.main.get_command(app)
    tried = {command.split(" -")[0] for command, _ in REFUSED}
    for name, command in program.commands.items():
        for words in [f"{name} {sub}" for sub in getattr(command, "commands", [])] or [name]:
            takes_something = any(
                p.name != "help" for p in getattr(command, "commands", {}).get(words.split()[-1], command).params
            )
            assert not takes_something or any(one.startswith(words) for one in tried), f"no bad input for {words}"
