"""Compiled code is kept where nobody else can write, and read from nowhere else: it is pickles, which run code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from syda_gym.embodiments.limb_ik.keeping import may_keep

pytestmark = pytest.mark.skipif(os.name != "posix", reason="permissions as POSIX knows them")

SCRIPT = """
import sys
from pathlib import Path
from syda_gym.embodiments.limb_ik.compiling import compiled
import one
made = compiled(one.double)
assert made(21.0) == 42.0
print("kept" if type(made._cache).__name__ == "FunctionCache" else "not kept")
"""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "house").mkdir(mode=0o755)
    path = tmp_path / "house" / "one.py"
    path.write_text("def double(x):\n    return 2.0 * x\n")
    return path


@pytest.mark.parametrize("mode", [0o700, 0o755, 0o770, 0o777, 0o1777])
def test_a_folder_beside_the_source_counts_if_no_more_people_can_write_there(source: Path, mode: int) -> None:
    folder = source.parent / "__pycache__"
    folder.mkdir()
    folder.chmod(mode)
    assert may_keep(folder, source) == (mode in (0o700, 0o755))
    source.parent.chmod(0o775)
    assert may_keep(folder, source) == (mode in (0o700, 0o755, 0o770)), "a group that may change the source anyway"


def test_a_folder_of_ones_own_elsewhere_is_closed_to_others(source: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(0o777)
    assert may_keep(folder, source)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert not may_keep(tmp_path / "none", source)


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root can give a folder to somebody")
def test_a_strangers_folder_never_counts(source: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, 12345)
    assert not may_keep(folder, source)
    os.chown(source.parent, 12345, 12345)
    assert may_keep(folder, source), "whose source it is"


def test_what_a_stranger_planted_is_not_read(source: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(Path(__file__).resolve().parents[3]), str(source.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": ""}
    folder = source.parent / "__pycache__"

    def run() -> str:
        command = [sys.executable, "-c", SCRIPT]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    assert run() == "kept"
    indices = list(folder.glob("*.nbi"))
    assert indices
    folder.chmod(0o777)
    for index in indices:  # a pickle that writes a file
        index.write_bytes(b"cposix\nsystem\n(S'touch " + str(tmp_path / "ran").encode() + b"'\ntR.")
    assert run() == "not kept"
    assert not (tmp_path / "ran").exists()
