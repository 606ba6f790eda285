"""Motion files: what is saved is what is read, and damage never passes."""

from __future__ import annotations

import contextlib
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.errors import EmbodimentError, MotionError
from syda_gym.motions import Motions, Take, generate, load_motions, save_motions
from syda_gym.motions.readers.own import npz
from syda_gym.motions.readers.own.npz import read_npz


@pytest.fixture(scope="module")
def motions() -> Motions:
    return generate(["adult", "pepper", "left_only"], actions=["wave_high", "push_up"])


@pytest.fixture(scope="module")
def stored(motions: Motions, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_motions(motions, tmp_path_factory.mktemp("npz") / "motions.npz")


def _same(a: Motions, b: Motions, step: float = 0.0) -> None:
    assert (a.name, a.synthetic, dict(a.families), dict(a.bodies)) == (
        b.name,
        b.synthetic,
        dict(b.families),
        dict(b.bodies),
    )
    assert len(a.takes) == len(b.takes)
    for first, second in zip(a.takes, b.takes, strict=True):
        assert (first.recording, first.action, first.fps, first.mirrored) == (
            second.recording, second.action, second.fps, second.mirrored,
        )  # fmt: skip
        assert set(first.frames) == set(second.frames)
        for name, frames in first.frames.items():
            np.testing.assert_allclose(second.frames[name], frames, atol=step, rtol=0)
        assert set(first.filled) == set(second.filled)
        for name, held in first.filled.items():
            np.testing.assert_array_equal(second.filled[name], held)
        if first.timestamps is None:
            assert second.timestamps is None
        else:
            np.testing.assert_array_equal(second.timestamps, first.timestamps)


def test_round_trip_is_exact(motions: Motions, stored: Path) -> None:
    _same(motions, load_motions(f"npz:{stored}"))
    _same(motions, load_motions(stored))


def test_rounded_file_is_near_and_small(motions: Motions, stored: Path, tmp_path: Path) -> None:
    small = save_motions(motions, tmp_path / "small.npz", steps={"m": 1e-3, "rad": 1e-4})
    _same(motions, read_npz(small), step=0.5e-3 + 1e-12)
    assert small.stat().st_size < 0.3 * stored.stat().st_size


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1), counts=st.lists(st.integers(1, 9), min_size=1, max_size=4), rounded=st.booleans()
)
def test_any_motions_survive(tmp_path: Path, seed: int, counts: list[int], rounded: bool) -> None:
    rng = np.random.default_rng(seed)
    bodies = {name: catalog.get(name) for name in ("kid", "nao")}
    takes = []
    for index, count in enumerate(counts):
        present = ["kid", "nao"] if rng.random() < 0.6 else ["kid"]
        frames = {name: rng.uniform(-3.2, 3.2, (count, bodies[name].n_features)) for name in present}
        held = rng.random((count, 18)) < 0.2
        takes.append(
            Take(f"r{index}", "a", 30.0, frames, bool(rng.random() < 0.5), {"kid": held} if held.any() else {},
                 np.cumsum(rng.random(count)) if rng.random() < 0.5 else None)
        )  # fmt: skip
    motions = Motions("any", tuple(takes), bodies)
    steps = {"m": 1e-3, "rad": 1e-4} if rounded else None
    _same(motions, read_npz(save_motions(motions, tmp_path / "any.npz", steps=steps)), step=0.6e-3 if rounded else 0.0)


def test_too_large_for_sixteen_bits(motions: Motions, tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="do not fit into 16 bits"):
        save_motions(motions, tmp_path / "x.npz", steps={"m": 1e-6})
    assert list(tmp_path.iterdir()) == []


def _rewritten(stored: Path, target: Path, **changes: object) -> Path:
    """The stored file with some arrays or meta entries replaced; ``None`` leaves an array out."""
    with np.load(stored) as archive:
        arrays = {name: archive[name] for name in archive.files}
    meta = json.loads(bytes(arrays["meta"]))
    for key, value in changes.items():
        if key in arrays:
            arrays[key] = value
        else:
            meta[key] = value
    if "meta" not in changes:
        arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    np.savez(target, **{name: value for name, value in arrays.items() if value is not None})
    return target


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other 7"}, "format 'other 7', expected"),
        ({"takes": []}, "no takes|has .* frames, its takes have 0"),
        ({"meta": None}, "no motion file of this library"),
        ({"meta": np.zeros(3, np.uint8)}, "no motion file of this library"),
        ({"frames_0": np.zeros((5, 18)), "filled_0": None}, "ends early for body 'adult'"),
        ({"frames_0": np.zeros((5, 17))}, r"expected \(N, 18\)"),
        ({"frames_0": np.zeros((5, 18), np.float32)}, "float32"),
        ({"frames_0": np.full((5, 18), np.nan)}, "frame 0 of 'adult'"),
        ({"frames_0": None, "filled_0": None}, "ends early for body 'adult'"),
        ({"filled_0": np.zeros(3, np.uint8)}, "marks of filled gaps"),
        ({"frames_1": np.array([None, "x"], dtype=object)}, r"no readable \.npz"),
    ],
)
def test_inconsistent_file(stored: Path, tmp_path: Path, changes: dict[str, object], message: str) -> None:
    with pytest.raises(MotionError, match=message) as caught:
        read_npz(_rewritten(stored, tmp_path / "bad.npz", **changes))
    assert "bad.npz" in str(caught.value)


def test_robot_with_other_joints(stored: Path, tmp_path: Path) -> None:
    with np.load(stored) as archive:
        bodies = json.loads(bytes(archive["meta"]))["bodies"]
    bodies[1]["spec"]["joints"][0] = "LeftShoulder"
    with pytest.raises(EmbodimentError, match="'pepper' has joints"):
        read_npz(_rewritten(stored, tmp_path / "bad.npz", bodies=bodies))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="no motion file"):
        read_npz(tmp_path / "none.npz")


def test_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An archive that would unpack to something huge is refused before unpacking."""
    monkeypatch.setattr(npz, "MAX_BYTES", 4 << 20)
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("frames_0.npy", bytes(5 << 20))
    with pytest.raises(MotionError, match="unpacks to 5 MB in 1 members; at most 4 MB"):
        read_npz(path)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 10**30) | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=4,
)


def _paths(value: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(found for key, inner in items for found in _paths(inner, (*path, key)))]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_nonsense_in_the_description_is_refused(stored: Path, tmp_path: Path, data: st.DataObject) -> None:
    with np.load(stored) as archive:
        meta = json.loads(bytes(archive["meta"]))
    place = data.draw(st.sampled_from(_paths(meta)[1:]))
    holder = meta
    for key in place[:-1]:
        holder = holder[key]  # type: ignore[index]
    holder[place[-1]] = data.draw(_JSON)
    path = _rewritten(stored, tmp_path / "odd.npz", meta=np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8))
    with contextlib.suppress(MotionError, EmbodimentError):
        read_npz(path).clips("adult")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_bytes_never_pass(motions: Motions, stored: Path, tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(stored.read_bytes())
    cut = data.draw(st.integers(0, len(content)))
    flips = data.draw(st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(1, 255)), max_size=6))
    for place, change in flips:
        content[place] ^= change
    if data.draw(st.booleans()):
        content = content[:cut]
    path = tmp_path / "damaged.npz"
    path.write_bytes(bytes(content))
    if bytes(content) == stored.read_bytes():
        return
    with contextlib.suppress(MotionError, EmbodimentError):
        _same(motions, read_npz(path))  # a byte that no checksum covers may change, but then nothing that is read
