from __future__ import annotations

import json

import numpy as np
import pytest

from syda_gym.errors import StorageError
from syda_gym.mappings import fit, load_mapping, save_mapping
from syda_gym.motions.clip import PairedMotions


@pytest.fixture(scope="module")
def mapping(adult_pepper: PairedMotions):
    return fit(adult_pepper, preset="paper", epochs=2)


def test_loading_gives_the_same_bits(mapping, adult_pepper, tmp_path):
    save_mapping(mapping, tmp_path / "m")
    loaded = load_mapping(tmp_path / "m")
    assert np.array_equal(loaded(adult_pepper.source), mapping(adult_pepper.source))
    assert np.array_equal(loaded.inverse()(adult_pepper.target), mapping.inverse()(adult_pepper.target))
    assert loaded.card == mapping.card


def test_a_chain_is_one_file(mapping, adult_kid, kid_pepper, tmp_path):
    chain = fit(adult_kid, preset="paper", epochs=1) >> fit(kid_pepper, preset="paper", epochs=1)
    save_mapping(chain, tmp_path / "chain.safetensors")
    loaded = load_mapping(tmp_path / "chain")
    assert loaded.route == ("adult", "kid", "pepper")
    assert np.array_equal(loaded(adult_kid.source), chain(adult_kid.source))


def test_missing_files_are_named(tmp_path):
    with pytest.raises(StorageError, match=r"none\.json"):
        load_mapping(tmp_path / "none")


def test_corrupt_weights_are_refused(mapping, tmp_path):
    path = save_mapping(mapping, tmp_path / "m")
    data = bytearray(path.read_bytes())
    data[-3] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(StorageError, match="does not match its card"):
        load_mapping(path)


def test_a_card_of_another_mapping_is_refused(mapping, adult_kid, tmp_path):
    save_mapping(mapping, tmp_path / "a")
    save_mapping(fit(adult_kid, preset="paper", epochs=1), tmp_path / "b")
    (tmp_path / "a.json").write_bytes((tmp_path / "b.json").read_bytes())
    with pytest.raises(StorageError, match="does not match its card"):
        load_mapping(tmp_path / "a")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("format", 99),
        ("source_features", ["x [m]"]),
        ("source", {"kind": "robot", "name": "pepper", "joints": [], "kinematics": "0"}),
        ("source", {"kind": "human", "name": "adult"}),
        ("surprise", 1),
    ],
)
def test_a_card_that_does_not_fit_is_refused(mapping, tmp_path, key, value):
    save_mapping(mapping, tmp_path / "m")
    content = json.loads((tmp_path / "m.json").read_text())
    content["links"][0]["card"][key] = value
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(StorageError):
        load_mapping(tmp_path / "m")


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"links": [], "weights": ""}', '{"links": [7], "weights": "x"}'])
def test_arbitrary_cards_are_refused(mapping, tmp_path, content):
    save_mapping(mapping, tmp_path / "m")
    (tmp_path / "m.json").write_text(content)
    with pytest.raises(StorageError):
        load_mapping(tmp_path / "m")


def test_a_number_beyond_all_bounds_is_refused(adult_pepper, tmp_path):
    save_mapping(fit(adult_pepper, method="ridge"), tmp_path / "m")
    content = json.loads((tmp_path / "m.json").read_text())
    content["links"][0]["regressor"]["settings"]["width"] = float("inf")
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(StorageError, match="do not fit together"):
        load_mapping(tmp_path / "m")


def test_weights_of_another_size_are_refused(mapping, tmp_path):
    from safetensors.numpy import load_file, save_file

    from syda_gym.files import fingerprint

    path = save_mapping(mapping, tmp_path / "m")
    arrays = load_file(path)
    arrays["0/regressor/encode_a.w0"] = arrays["0/regressor/encode_a.w0"][:-1]
    save_file(arrays, path)
    content = json.loads((tmp_path / "m.json").read_text())
    content["weights"] = fingerprint(path.read_bytes())
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(StorageError, match="do not fit together"):
        load_mapping(path)


def test_an_unknown_kind_is_refused(mapping, tmp_path):
    save_mapping(mapping, tmp_path / "m")
    content = json.loads((tmp_path / "m.json").read_text())
    content["links"][0]["regressor"]["kind"] = "os.system"
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(StorageError, match="unknown model"):
        load_mapping(tmp_path / "m")
