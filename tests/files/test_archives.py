"""Archives that say other things than they hold."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from syda_gym.errors import StorageError
from syda_gym.files.archives import read_arrays

_LISTED = b"PK\x01\x02"


def test_a_member_that_is_said_to_be_larger_than_its_archive_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "lies.npz"
    np.savez_compressed(file, first=np.arange(3.0), second=np.arange(4.0))
    content = bytearray(file.read_bytes())
    place = content.rfind(_LISTED)
    content[place + 20 : place + 24] = struct.pack("<I", 0xF8000000)  # 4 GB packed, which zipfile would make room for
    file.write_bytes(content)
    with pytest.raises(StorageError, match=r"is damaged: 'second\.npy' is said to take 4160749568 of its"):
        read_arrays(file, "arrays")


def test_a_sound_one_is_read(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "sound.npz", first=np.arange(3.0))
    np.testing.assert_array_equal(read_arrays(tmp_path / "sound.npz", "arrays")["first"], np.arange(3.0))
