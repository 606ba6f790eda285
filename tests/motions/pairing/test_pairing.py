"""Time alignment, quality per action, the data set folder and its validator, re-expressing an operator."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.parametric import parametric_human
from syda_gym.errors import EmbodimentError, MotionError, OptionError, StorageError
from syda_gym.motions import (
    MotionClip,
    Motions,
    Take,
    align,
    conformed,
    describe,
    generate,
    load_motions,
    pair_quality,
    pair_recordings,
    read_dataset,
    validate_dataset,
    write_dataset,
)
from syda_gym.motions.pairing.conform import limb_directions_of

pytestmark = pytest.mark.filterwarnings("ignore::syda_gym.motions.readers.skeleton.MotionWarning")


@pytest.fixture(scope="module")
def motions() -> Motions:
    return generate(["adult", "pepper"], actions=["wave_high", "drum", "push_side"], variants=1)


@pytest.fixture(scope="module")
def exact() -> Motions:
    """Bodies that move alike and in time."""
    return generate(["adult", "tall"], actions=["wave_high"], variants=1, noise=0.0, variety=0.0)


@pytest.fixture
def folder(motions: Motions, tmp_path: Path) -> Path:
    return write_dataset(motions, tmp_path / "set")


@settings(max_examples=20, deadline=None)
@given(shift=st.integers(-25, 25))
def test_a_known_shift_is_found(exact: Motions, shift: int) -> None:
    adult, tall = exact.bodies["adult"], exact.bodies["tall"]
    a, b = exact.takes[0].frames["adult"], exact.takes[0].frames["tall"]
    late = np.concatenate([np.repeat(a[:1], shift, axis=0), a]) if shift > 0 else a[-shift:]
    found = align(adult, late, tall, b, fps=30.0)
    assert abs(found.shift - shift) <= 1
    assert abs(found.lag - shift / 30.0) < 0.04
    assert found.correlation > 0.98
    assert found.correlation >= found.unshifted


def test_pairing_cuts_to_the_overlap_and_keeps_gaps(exact: Motions) -> None:
    take = exact.takes[0]
    late = np.concatenate([np.repeat(take.frames["adult"][:1], 9, axis=0), take.frames["adult"]])
    filled = np.zeros(late.shape, dtype=bool)
    filled[50:55, :3] = True
    operator = MotionClip(exact.bodies["adult"], late, 30.0, "wave", "camera", filled=filled)
    robot = MotionClip(exact.bodies["tall"], take.frames["tall"], 30.0, "prompt", "played")
    paired, found = pair_recordings(operator, robot)
    assert paired.action == "prompt"
    assert abs(found.shift - 9) <= 1
    lengths = {name: len(frames) for name, frames in paired.frames.items()}
    assert len(set(lengths.values())) == 1
    assert np.flatnonzero(paired.filled["adult"][:, 0]).tolist() == list(range(50 - found.shift, 55 - found.shift))
    again = align(exact.bodies["adult"], paired.frames["adult"], exact.bodies["tall"], paired.frames["tall"], fps=30.0)
    assert again.shift == 0


def test_pairing_by_one_clock_at_different_rates(exact: Motions) -> None:
    """A camera with uneven timestamps that started 1.7 s before the robot's prompt."""
    take = exact.takes[0]
    still = np.repeat(take.frames["adult"][:1], 51, axis=0)
    frames = np.concatenate([still, take.frames["adult"]])
    stamps = 100.0 + np.arange(len(frames)) / 30.0 + 0.004 * np.sin(np.arange(len(frames)))
    operator = MotionClip(exact.bodies["adult"], frames, 30.0, "wave", "camera", timestamps=stamps)
    prompt = take.frames["tall"]
    robot = MotionClip(
        exact.bodies["tall"],
        prompt[::2],
        15.0,
        "prompt",
        "played",
        timestamps=101.7 + np.arange(len(prompt[::2])) / 15.0,
    )
    paired, found = pair_recordings(operator, robot, same_clock=True, max_lag=0.4)
    assert paired.fps == 15.0
    assert abs(found.lag) < 0.06
    assert found.correlation > 0.98


@pytest.mark.parametrize(
    ("change", "message"),
    [({"timestamps": None}, "needs timestamps"), ({"timestamps": 500.0 + np.arange(99) / 30.0}, "do not overlap")],
)
def test_pairing_that_cannot_work(exact: Motions, change: dict[str, object], message: str) -> None:
    take = exact.takes[0]
    adult = MotionClip(
        exact.bodies["adult"], take.frames["adult"][:99], 30.0, "a", "camera", timestamps=np.arange(99) / 30.0
    )
    tall = MotionClip(
        exact.bodies["tall"], take.frames["tall"][:99], 30.0, "a", "played", timestamps=np.arange(99) / 30.0
    )
    with pytest.raises(MotionError, match=message):
        pair_recordings(replace(adult, **change), tall, same_clock=True)  # type: ignore[arg-type]
    with pytest.raises(MotionError, match="needs two bodies"):
        pair_recordings(adult, adult)


def test_alignment_refuses_nonsense(exact: Motions) -> None:
    adult, frames = exact.bodies["adult"], exact.takes[0].frames["adult"]
    with pytest.raises(MotionError, match="too few to align"):
        align(adult, frames[:3], adult, frames, fps=30.0)
    with pytest.raises(OptionError, match="must be positive"):
        align(adult, frames, adult, frames, fps=0.0)
    right = parametric_human("right_only", sides=("right",))
    left = catalog.get("left_only")
    with pytest.raises(MotionError, match="no arm in common"):
        align(right, frames[:, 9:], left, frames[:, :9], fps=30.0)


def test_quality_tells_the_mispaired_action(motions: Motions) -> None:
    """Waving paired with drumming is poor, the rest is good."""
    drum = next(take for take in motions.takes if take.action == "drum")
    takes = []
    for take in motions.takes:
        frames = dict(take.frames)
        if take.action == "wave_high":
            count = min(len(frames["pepper"]), len(drum.frames["adult"]))
            frames = {"adult": drum.frames["adult"][:count], "pepper": frames["pepper"][:count]}
        takes.append(replace(take, frames=frames, filled={}))
    verdicts = {q.action: q.verdict for q in pair_quality(replace(motions, takes=tuple(takes)).pair("adult", "pepper"))}
    assert verdicts == {"wave_high": "poor", "drum": "good", "push_side": "good"}


def test_quality_of_the_papers_recordings(paper_dir: Path) -> None:
    """What is known of them: H07 is mis-paired, H06 fair, the others good; lags of up to 0.7 s."""
    qualities = {q.action: q for q in pair_quality(load_motions(paper_dir).pair("adult", "kid"))}
    assert [name for name, q in qualities.items() if q.verdict == "poor"] == ["H07"]
    assert [name for name, q in qualities.items() if q.verdict == "fair"] == ["H06"]
    assert qualities["H07"].correlation == pytest.approx(0.47, abs=0.02)
    assert max(abs(q.lag) for q in qualities.values()) < 0.7


def test_dataset_round_trip(motions: Motions, folder: Path) -> None:
    again = load_motions(folder)
    assert load_motions(folder / "dataset.json").name == again.name
    assert (again.name, again.synthetic, again.families, again.bodies) == (
        motions.name, motions.synthetic, motions.families, motions.bodies,
    )  # fmt: skip
    for first, second in zip(motions.takes, again.takes, strict=True):
        assert (first.recording, first.action, first.fps, first.timestamps) == (
            second.recording, second.action, second.fps, second.timestamps,
        )  # fmt: skip
        for name, frames in first.frames.items():
            np.testing.assert_array_equal(frames, second.frames[name])
        assert set(first.filled) == set(second.filled)
        for name, marks in first.filled.items():
            np.testing.assert_array_equal(marks, second.filled[name])
    assert any(take.filled for take in again.takes)


def test_dataset_keeps_timestamps(tmp_path: Path, motions: Motions) -> None:
    take = motions.takes[0]
    stamps = 5.0 + np.cumsum(np.full(len(take.frames["adult"]), 0.031))
    stamped = replace(motions, takes=(replace(take, timestamps=stamps),))
    again = read_dataset(write_dataset(stamped, tmp_path / "stamped"))
    np.testing.assert_array_equal(again.takes[0].timestamps, stamps)


def test_a_second_data_set_is_not_written_over_the_first(motions: Motions, folder: Path) -> None:
    with pytest.raises(MotionError, match="already holds a data set"):
        write_dataset(motions, folder)


def test_a_broken_write_leaves_no_data_set(motions: Motions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*args: object) -> None:
        raise StorageError("disk full")

    monkeypatch.setattr("syda_gym.motions.dataset.write_json", fail)
    with pytest.raises(StorageError):
        write_dataset(motions, tmp_path / "set")
    with pytest.raises(MotionError, match=r"no data set: it has no dataset\.json"):
        read_dataset(tmp_path / "set")


def test_validator_finds_nothing_wrong_with_good_data(folder: Path) -> None:
    findings = validate_dataset(folder)
    assert {finding.level for finding in findings} == {"info"}
    assert len(findings) == 3


def test_validator_lists_all_faults(folder: Path) -> None:
    lines = (folder / "takes" / "0001.csv").read_text().splitlines()
    lines[7] = lines[7].replace(",", ",x", 1)
    (folder / "takes" / "0001.csv").write_text("\n".join(lines))
    (folder / "takes" / "0002.csv").unlink()
    lines = (folder / "takes" / "0003.csv").read_text().splitlines()
    column = lines[0].split(",").index("pepper:RElbowRoll")
    cells = lines[20].split(",")
    cells[column] = "2.5"
    lines[20] = ",".join(cells)
    (folder / "takes" / "0003.csv").write_text("\n".join(lines))
    (folder / "takes" / "extra.csv").write_text("time\n")
    findings = validate_dataset(folder)
    said = [f"{finding.level} {finding.place}: {finding.message}" for finding in findings]
    assert any("error takes/0001.csv" in line and "line 8, column 2" in line for line in said)
    assert any("error takes/0002.csv" in line and "no file" in line for line in said)
    assert any("warning" in line and "RElbowRoll in frame 19" in line for line in said)
    assert any("moves at" in line and "rad/s" in line for line in said)
    assert any("extra.csv" in line and "not listed" in line for line in said)
    assert any("1 action; leave-one-action-out needs" in line for line in said)
    assert [finding.level for finding in findings] == sorted(
        (finding.level for finding in findings), key=["error", "warning", "info"].index
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("time,", "t,", "first column must be 'time'"),
        ("adult:LElbow.y", "adult:LElbow.q", r"column 'adult:LElbow\.y' is missing"),
        ("adult:LElbow.y", "adult:LElbow.x", r"column 'adult:LElbow\.x' occurs twice"),
        ("pepper:LElbowYaw", "peper:LElbowYaw", "is of no body"),
        ("\n0.1,", "\n0.0,", r"line 5: time must increase"),
        ("\n0.1,", "\n0.1,,", "columns, the header has"),
        ("\n0.1,", "\nnan,", "line 5: time is empty or NaN"),
    ],
)
def test_damaged_take(folder: Path, old: str, new: str, message: str) -> None:
    path = folder / "takes" / "0001.csv"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MotionError, match=message) as caught:
        read_dataset(folder)
    assert "0001.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", "other", 'expected "format"'),
        ("takes", [], "expected 'takes'"),
        ("takes", [{"file": "takes/0001.csv"}], "take 0 needs the keys"),
        ("bodies", {"a b": {}}, "body 'a b' needs a name"),
        ("bodies", {"adult": {"kind": "human"}}, "described wrongly"),
        ("families", 3, "'families' must be a dict"),
        (
            "takes",
            [{"file": "../../x.csv", "recording": "r", "action": "a", "fps": 30, "mirrored": False}],
            "lies outside",
        ),
        ("takes", [{"file": "takes/0001.csv", "recording": "r", "action": "a", "fps": 0, "mirrored": False}], "fps of"),
    ],
)
def test_damaged_index(folder: Path, key: str, value: object, message: str) -> None:
    index = json.loads((folder / "dataset.json").read_text())
    index[key] = value
    (folder / "dataset.json").write_text(json.dumps(index))
    with pytest.raises(MotionError, match=message):
        read_dataset(folder)
    assert any(finding.level == "error" for finding in validate_dataset(folder))


def test_unknown_robot_in_the_index(folder: Path) -> None:
    text = (folder / "dataset.json").read_text().replace('"name": "pepper"', '"name": "peper"')
    (folder / "dataset.json").write_text(text)
    with pytest.raises(EmbodimentError, match="did you mean 'pepper'"):
        read_dataset(folder)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_raises_anything_else(folder: Path, data: st.DataObject) -> None:
    path = data.draw(st.sampled_from([folder / "dataset.json", folder / "takes" / "0001.csv"]))
    original = path.read_text()
    start = data.draw(st.integers(0, len(original)))
    stop = start + data.draw(st.sampled_from([0, 1, 30, 3000]))
    junk = data.draw(st.sampled_from(["", ",", "\n", "{", "]", "null", "nan", "-1", '"', "1e999", "ffff"]))
    try:
        path.write_text(original[:start] + junk + original[stop:])
        with contextlib.suppress(MotionError, EmbodimentError):
            read_dataset(folder)
        validate_dataset(folder)
    finally:
        path.write_text(original)


def test_an_operator_becomes_the_adult_of_the_catalog() -> None:
    own = parametric_human("me", stature=1.6, arm_proportion=0.9, axes=np.eye(3))
    motions = generate([own, "nao"], actions=["wave_high"], variants=1)
    adult = catalog.get("adult")
    assert isinstance(adult, HumanSkeleton)
    again = conformed(motions, "me", adult)
    assert list(again.bodies) == ["adult", "nao"]
    first, second = motions.clips("me")[0], again.clips("adult")[0]
    np.testing.assert_allclose(
        limb_directions_of(first.body, first.frames), limb_directions_of(adult, second.frames), atol=1e-12
    )
    lengths = np.linalg.norm(np.diff(adult.arm_points(second.frames), axis=2), axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(adult.arm_lengths, lengths.shape))
    assert again.pair("adult", "nao").fps == 30.0
    left = catalog.get("left_only")
    assert isinstance(left, HumanSkeleton)
    one = conformed(motions, "me", left).clips("left_only")[0]
    np.testing.assert_allclose(
        limb_directions_of(left, one.frames)[:, 0], limb_directions_of(adult, second.frames)[:, 0]
    )


def test_conforming_refuses_what_it_cannot_do(motions: Motions) -> None:
    adult, one = catalog.get("adult"), catalog.get("left_only")
    assert isinstance(adult, HumanSkeleton)
    assert isinstance(one, HumanSkeleton)
    with pytest.raises(MotionError, match="only humans"):
        conformed(motions, "pepper", adult)
    with pytest.raises(MotionError, match="no right arm"):
        conformed(generate([one], actions=["drum"], variants=1), "left_only", adult)


def test_description_of_the_embedded_motions(tmp_path: Path) -> None:
    info = describe("embedded", picture=tmp_path / "info.png", clips=1)
    assert info.synthetic
    assert info.takes == 104
    assert len(info.actions) >= 40
    assert len(info.bodies) == 9
    assert len(info.pairs) == 36
    assert info.fps == (30.0, 30.0)
    adult = next(body for body in info.bodies if body.name == "adult")
    assert (adult.upper_arm, adult.forearm, adult.features) == (0.294, 0.287, 18)
    assert 0.0 < adult.filled < 0.05
    assert 0.5 < adult.fastest < 10.0
    assert (tmp_path / "info.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert json.loads(json.dumps(info.to_dict()))["pairs"][0][2] == info.frames


def test_description_says_what_a_reader_found(shared_dir: Path) -> None:
    info = describe(shared_dir / "data" / "kinect" / "laban_Ges02_balancinghands.csv")
    assert info.timestamps
    assert any("metres" in note for note in info.notes)
    assert info.seconds == pytest.approx(5.4, abs=0.1)


def test_take_with_one_body_makes_no_pair() -> None:
    adult = catalog.get("adult")
    motions = Motions("one", (Take("r", "a", 30.0, {"adult": np.ones((5, 18))}),), {"adult": adult})
    assert motions.pairs == ()
    assert describe(motions).pairs == ()
