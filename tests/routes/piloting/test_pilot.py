"""The one road from body to body: motions that are named, what this user recorded, else the unfitted mapping."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import syda_gym
from syda_gym.embodiments import catalog
from syda_gym.errors import MotionError, OptionError, RouteError, StorageError
from syda_gym.motions import write_dataset
from syda_gym.motions.clip import Motions, Take
from syda_gym.motions.recordings import joined, new_recording, recorded, recordings_folder
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.routes.piloting.own import fit_own
from syda_gym.routes.piloting.pilot import Pilot
from tests.mappings.conftest import make_pair


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


def tall(name: str) -> syda_gym.HumanSkeleton:
    return syda_gym.HumanSkeleton(name, height=1.9, upper_arm=0.35, forearm=0.3, shoulders=0.35)


def session(source: str, target: str, actions: int = 3, seed: int = 0, first: int = 0) -> Motions:
    """A recording session of made-up reaches."""
    pair = make_pair(source, target, actions=actions, seed=seed)
    takes = tuple(
        Take(
            f"take{number}",
            f"reach{first + number}",
            pair.fps,
            {source: clip.source.frames, target: clip.target.frames},
        )
        for number, clip in enumerate(pair.clips())
    )
    return Motions("session", takes, {source: pair.source_body, target: pair.target_body})


def test_without_recordings_it_is_unfitted_and_says_so(home: Path) -> None:
    mapping, notices = choose_mapping("adult", "pepper")
    assert (mapping.method, mapping.preset) == ("geometric", "unfitted")
    assert notices == ("no recordings of you with pepper: unfitted; `syda-gym record` improves it",)
    named, none = choose_mapping("adult", "pepper", mapping="geometric")
    assert none == ()
    standing = mapping.source.standing()  # type: ignore[attr-defined]
    assert np.array_equal(named(standing), mapping(standing))


def test_synthetic_motions_serve_only_by_name(home: Path) -> None:
    mapping, notices = choose_mapping("adult", "pepper", motions="embedded", route=("adult", "pepper"))
    assert (mapping.method, mapping.preset, notices) == ("syda", "general", ())
    write_dataset(replace(session("adult", "pepper"), synthetic=True), new_recording("adult", "pepper"))
    mapping, notices = choose_mapping("adult", "pepper")
    assert mapping.preset == "unfitted"
    assert "its motions are synthetic" in notices[1]


def test_what_was_recorded_is_fitted(home: Path) -> None:
    write_dataset(session("adult", "pepper"), new_recording("adult", "pepper"))
    mapping, notices = choose_mapping("adult", "pepper")
    assert (mapping.method, mapping.preset) == ("syda", "general")
    assert mapping.card.actions == ["reach0", "reach1", "reach2"]
    assert notices == ("your recordings of adult and pepper are used",)
    assert choose_mapping("adult", "pepper", mapping="ridge")[0].method == "ridge"
    assert choose_mapping("adult", "pepper", mapping="geometric")[0].preset == "unfitted"
    # Another robot knows nothing of it.
    assert choose_mapping("adult", "nao")[0].preset == "unfitted"


def test_a_route_through_a_known_body_is_found(home: Path) -> None:
    write_dataset(session("kid", "adult"), home / "recordings" / "with-adult")
    write_dataset(session("adult", "pepper"), home / "recordings" / "adult-pepper")
    mapping, _ = choose_mapping("kid", "pepper")
    assert mapping.route == ("kid", "adult", "pepper")


def test_sessions_are_joined_and_broken_ones_left_out(home: Path) -> None:
    write_dataset(session("adult", "pepper", first=0), new_recording("adult", "pepper"))
    write_dataset(session("adult", "pepper", first=3, seed=1), new_recording("adult", "pepper"))
    broken = recordings_folder() / "broken"
    broken.mkdir()
    (broken / "dataset.json").write_text("{")
    found = recorded()
    assert found.motions is not None
    assert len(found.motions.pair("adult", "pepper").action_names) == 6
    assert len({take.recording for take in found.motions.takes}) == 6
    assert "broken left out" in found.notices[0]
    mapping, notices = choose_mapping("adult", "pepper")
    assert len(mapping.card.actions) == 6
    assert "broken left out" in notices[1]
    other = session("adult", "pepper")
    taller = replace(other, bodies={**other.bodies, "adult": tall("adult")})
    with pytest.raises(MotionError, match="differs"):
        joined([other, taller], "both")


def test_routes_that_nobody_recorded_are_refused(home: Path) -> None:
    with pytest.raises(RouteError, match="no mapping leads from or to 'kid'"):
        choose_mapping("adult", "pepper", route=("adult", "kid", "pepper"))
    with pytest.raises(OptionError, match="is no method"):
        choose_mapping("adult", "pepper", mapping="sida")
    write_dataset(session("adult", "pepper"), new_recording("adult", "pepper"))
    with pytest.raises(RouteError, match="no mapping leads from or to 'kid'"):
        choose_mapping("adult", "pepper", route=("adult", "kid", "pepper"))


def test_the_environment_takes_the_same_road(home: Path) -> None:
    embedded = syda_gym.load_motions("embedded")
    few = replace(
        embedded,
        takes=tuple(replace(t, frames={"adult": t.frames["adult"]}) for t in embedded.takes[:2] if "adult" in t.frames),
        bodies={"adult": embedded.bodies["adult"]},
    )
    with pytest.warns(UserWarning, match="no recordings of you with nao: unfitted"):
        env = gym.make("SydaTeleop-v0", motions=few, robot="nao", physics="servo")
    env.reset(seed=0)
    env.close()
    write_dataset(session("adult", "nao"), new_recording("adult", "nao"))
    with pytest.warns(UserWarning, match="your recordings of adult and nao are used"):
        env = gym.make("SydaTeleop-v0", motions=few, robot="nao", physics="servo")
    env.close()


def test_fit_saves_where_teleop_looks_and_adds_later(home: Path, tmp_path: Path) -> None:
    write_dataset(session("adult", "pepper", actions=2), tmp_path / "first")
    done = fit_own([tmp_path / "first"])
    assert done.path == home / "mappings" / "adult-pepper.safetensors"
    assert [row.actions for row in done.judged.rows] == [0, 1]
    assert done.judged.bound is not None
    stored, notices = choose_mapping("adult", "pepper")
    assert stored.card.actions == ["reach0", "reach1"]
    assert notices == ("your recordings of adult and pepper are used",)
    write_dataset(session("adult", "pepper", actions=2, first=2, seed=1), tmp_path / "second")
    more = fit_own([tmp_path / "second"], add=True)
    assert len(more.sources) == 2
    assert [row.actions for row in more.judged.rows] == [0, 1, 2, 3]
    again = fit_own([tmp_path / "second"], add=True)
    assert len(again.sources) == 2, "adding the same data set again changes nothing"
    assert again.judged.mapping.card.data == more.judged.mapping.card.data
    content = json.loads((home / "mappings" / "fits" / "adult-pepper.json").read_text())
    assert [row["actions"] for row in content["rows"]] == [0, 1, 2, 3]


def test_fit_says_what_is_wrong(home: Path, tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="holds no recordings to fit on"):
        fit_own()
    with pytest.raises(OptionError, match="nothing to add"):
        fit_own(add=True)
    with pytest.raises(OptionError, match="--from and --to"):
        fit_own(["embedded"])
    write_dataset(session("adult", "pepper", actions=1), tmp_path / "one")
    with pytest.raises(MotionError, match="no recordings of 'kid' with 'nao'"):
        fit_own([tmp_path / "one"], ends=("kid", "nao"))
    with pytest.raises(StorageError, match="nothing to add to"):
        fit_own([tmp_path / "one"], add=True)
    done = fit_own([tmp_path / "one"])
    assert done.judged.bound is None
    assert "nothing can be held out" in done.judged.advice
    (tmp_path / "one").rename(tmp_path / "moved")
    write_dataset(session("adult", "pepper", actions=2, first=1), tmp_path / "two")
    with pytest.raises(StorageError, match="cannot be read any more"):
        fit_own([tmp_path / "two"], add=True)


def test_a_broken_stored_mapping_does_not_stop_a_live_start(home: Path, tmp_path: Path) -> None:
    write_dataset(session("adult", "pepper", actions=2), tmp_path / "data")
    path = fit_own([tmp_path / "data"]).path
    path.write_bytes(b"broken")
    mapping, notices = choose_mapping("adult", "pepper")
    assert mapping.preset == "unfitted"
    assert "left out" in notices[1]


def test_a_pilot_may_pass_bodies_that_are_no_names(home: Path) -> None:
    taller = tall("taller")
    pilot = Pilot(None, taller, catalog.get("pepper"), mapping="auto")
    mapping = pilot.mapping(pilot.plan("auto")[0].bodies)
    assert mapping.source == taller
    assert mapping.preset == "unfitted"
    assert pilot.fitted == (("taller", "pepper"),)
