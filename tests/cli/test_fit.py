"""``syda-gym fit``: the table of what each action gained, JSON, and where the mapping goes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syda_gym.cli.main import app
from syda_gym.motions import write_dataset
from tests.routes.piloting.test_pilot import session


def test_the_command_prints_what_each_action_gained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path / "home"))
    write_dataset(session("adult", "pepper", actions=3), tmp_path / "data")
    result = CliRunner().invoke(app, ["fit", str(tmp_path / "data")])
    assert result.exit_code == 0, result.output
    assert "0 (unfitted)" in result.output
    assert "error bound on unseen actions" in result.output
    as_json = CliRunner().invoke(
        app, ["fit", str(tmp_path / "data"), "--json", "--out", str(tmp_path / "mine.safetensors")]
    )
    assert [row["actions"] for row in json.loads(as_json.stdout)["rows"]] == [0, 1, 2]
    assert (tmp_path / "mine.safetensors").is_file()
    assert CliRunner().invoke(app, ["fit", str(tmp_path / "data"), "--operator", "adult"]).exit_code != 0
