import os

import pytest

from syda_gym.errors import MissingExtraError, StorageError, SydaError, nearest_name
from syda_gym.files import atomic_path, fingerprint, read_json, write_json, write_text


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = write_text(tmp_path / "a" / "x.txt", "old")

    def fail_halfway():
        with atomic_path(path) as temporary:
            temporary.write_text("new")
            raise RuntimeError("halfway")

    with pytest.raises(RuntimeError, match="halfway"):
        fail_halfway()
    assert path.read_text() == "old"
    assert [p.name for p in path.parent.iterdir()] == ["x.txt"]


def test_json_round_trip_and_limits(tmp_path):
    path = write_json(tmp_path / "x.json", {"b": [1, 2], "a": None})
    assert read_json(path) == {"a": None, "b": [1, 2]}
    with pytest.raises(StorageError, match="larger than"):
        read_json(path, limit=3)
    with pytest.raises(StorageError, match="no file"):
        read_json(tmp_path / "y.json")
    for text in ("{", "[" * 100_000):  # the second is nested deeper than the parser's stack
        path.write_text(text)
        with pytest.raises(StorageError, match="not valid JSON"):
            read_json(path)


def test_a_folder_that_is_a_file_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        write_text(tmp_path / "file" / "x.txt", "")


def test_fingerprints_tell_boundaries_apart():
    assert fingerprint("ab", "c") != fingerprint("a", "bc")
    assert fingerprint(b"ab") == fingerprint("ab")


def test_errors_name_the_remedy():
    assert "syda-gym[ik]" in str(MissingExtraError("mink", "ik"))
    assert "did you mean 'kid'" in nearest_name("kidd", ["kid", "adult"])
    assert issubclass(StorageError, SydaError)
    assert issubclass(StorageError, OSError)


@pytest.mark.skipif(os.name != "posix", reason="permissions as POSIX knows them")
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_files_keep_the_users_umask(tmp_path, mask):
    before = os.umask(mask)
    try:
        path = write_text(tmp_path / "note.txt", "hello")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_neighbours_temporary_file_is_left_alone(tmp_path):
    with atomic_path(tmp_path / "x.txt") as theirs:
        theirs.write_text("theirs")
        write_text(tmp_path / "x.txt", "ours")
        assert theirs.read_text() == "theirs"
        assert theirs.name.startswith(".x-")
    assert (tmp_path / "x.txt").read_text() == "theirs"
    assert [path.name for path in tmp_path.iterdir()] == ["x.txt"]
