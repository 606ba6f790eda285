"""Motions on a page: chosen, paused, stepped through; and the commands that show them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from syda_gym.cli import viewing
from syda_gym.cli.main import app
from syda_gym.errors import OptionError
from syda_gym.simulation.page.showing import Player, Shown


class TestPlayer:
    def player(self) -> tuple[Player, list[float]]:
        now = [0.0]
        rows = np.arange(20.0)[:, None]
        shown = [Shown("first", 10.0, {"robot": rows}), Shown("second", 10.0, {"robot": rows + 100.0})]
        return Player(shown, clock=lambda: now[0]), now

    def pose(self, player: Player) -> float:
        return float(player.look()["poses"]["robot"][0])

    def test_time_goes_on_and_begins_again(self) -> None:
        player, now = self.player()
        assert self.pose(player) == 0.0
        now[0] = 0.5
        assert self.pose(player) == 5.0
        now[0] = 2.3
        assert self.pose(player) == 3.0

    def test_paused_it_stands_and_goes_frame_by_frame(self) -> None:
        player, now = self.player()
        now[0] = 0.5
        player.press("pause")
        now[0] = 1.7
        assert self.pose(player) == 5.0
        player.press("ahead")
        assert self.pose(player) == 6.0
        player.press("back")
        player.press("back")
        assert self.pose(player) == 4.0
        player.press("pause")
        now[0] = 1.8
        assert self.pose(player) == 5.0

    def test_another_motion_begins_at_its_beginning(self) -> None:
        player, now = self.player()
        now[0] = 0.7
        player.choose("second")
        assert self.pose(player) == 100.0
        player.choose("no such motion")
        assert self.pose(player) == 100.0

    def test_nothing_to_show_is_refused(self) -> None:
        with pytest.raises(OptionError, match="nothing to show"):
            Player([])


class TestCommands:
    @pytest.fixture
    def shown(self, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
        """What commands ask the page to show; it is not opened."""
        pages: list[dict[str, Any]] = []

        def keep(title: str, bodies: Any, shown: Any, **options: Any) -> None:
            pages.append({"title": title, "bodies": bodies, "shown": shown, **options})

        monkeypatch.setattr("syda_gym.simulation.page.showing.show", keep)
        return pages

    def test_motions_info_shows_every_take_with_its_bodies(self, shown: list[dict[str, Any]]) -> None:
        result = CliRunner().invoke(app, ["motions", "info", "embedded", "--view"], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        page = shown[0]
        assert len(page["shown"]) > 20
        names = {body.name for body in page["bodies"]}
        assert all(set(each.poses) <= names for each in page["shown"])

    def test_play_shows_operator_robot_ghost_and_error(self, shown: list[dict[str, Any]]) -> None:
        result = CliRunner().invoke(app, ["play", "base", "--view", "--physics-hz", "240"], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        page = shown[0]
        assert {body.name for body in page["bodies"]} == {"robot", "ghost", "operator"}
        assert len(page["shown"][0].values) == len(page["shown"][0])

    def test_robot_add_shows_its_arms_and_lines_that_must_lie_on_them(
        self, shown: list[dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from syda_gym.files import asset

        monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
        command = ["robot", "add", str(asset("robots", "nao.urdf")), "--name", "my-nao", "--no-suggest", "--view"]
        result = CliRunner().invoke(app, command, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        page = shown[0]
        assert {body.name for body in page["bodies"]} == {"robot", "arms"}
        motion = page["shown"][0]
        assert motion.poses["arms"].shape == (len(motion), 6, 3)
        assert np.ptp(motion.poses["robot"], axis=0).max() > 0.5

    def test_a_page_beyond_this_machine_asks_for_a_token(self, shown: list[dict[str, Any]]) -> None:
        with pytest.raises(OptionError, match="token"):
            viewing._show("title", [], [], "0.0.0.0:8099", [], 1.7, 0.0)
        assert not shown
