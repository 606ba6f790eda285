"""One writer a folder: a second one is told who has it, what a killed one left is taken over."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from syda_gym.errors import StorageError
from syda_gym.locks import locked_folder

HOLDER = """
import sys, time
from syda_gym.locks import locked_folder
with locked_folder(sys.argv[1]):
    print("held", flush=True)
    time.sleep(300)
"""


def test_a_second_writer_is_told_who_has_the_folder(tmp_path):
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    try:
        assert holder.stdout.readline() == "held\n"
        words = f"being written by process {holder.pid} on "
        with pytest.raises(StorageError, match=words) as caught, locked_folder(tmp_path):
            pytest.fail("two writers")
        assert re.search(r"choose another folder", str(caught.value))
    finally:
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    assert list(tmp_path.iterdir()) != []  # what the killed one left
    with locked_folder(tmp_path) as folder:
        assert folder == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_two_in_one_process_exclude_each_other_and_other_names_do_not(tmp_path):
    with locked_folder(tmp_path):
        with pytest.raises(StorageError, match=f"process {os.getpid()} "), locked_folder(tmp_path):
            pytest.fail("two writers")
        with locked_folder(tmp_path, "training"), locked_folder(tmp_path / "inside"):
            pass
    with locked_folder(tmp_path):
        pass


RACER = """
import sys, time
from pathlib import Path
from syda_gym.errors import StorageError
from syda_gym.locks import locked_folder
folder, mine, until = Path(sys.argv[1]), Path(sys.argv[1]) / "inside", float(sys.argv[2])
won = 0
while time.time() < until:
    try:
        with locked_folder(folder):
            mine.touch(exist_ok=False)
            won += 1
            time.sleep(0.001)
            mine.unlink()
    except StorageError:
        pass
print(won)
"""


def test_among_many_there_is_never_more_than_one(tmp_path):
    until = time.time() + 6.0
    racers = [
        subprocess.Popen([sys.executable, "-c", RACER, str(tmp_path), str(until)], stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    won = [int(racer.communicate()[0]) for racer in racers]
    assert [racer.returncode for racer in racers] == [0, 0, 0]  # ``touch`` never found another's file
    assert sum(won) > 20


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(StorageError, match="choose another folder with --out"), locked_folder(Path(blocked)):
        pass
