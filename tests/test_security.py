"""SECURITY.md promises nothing without a test that shows it: the tests and builders that it names are there."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from fuzz_build import BUILDERS  # noqa: E402

TEXT = (ROOT / "SECURITY.md").read_text()
NAMED = sorted(set(re.findall(r"`((?:tests|scripts)/[^`]*)`", TEXT)))
BUILT = {build.__name__ for builders in BUILDERS.values() for build in builders}


@pytest.mark.parametrize("named", NAMED)
def test_what_is_named_exists(named: str) -> None:
    address = named.split()[0]
    path, _, test = address.partition("::")
    file = ROOT / path
    assert file.is_file()
    if test:
        assert f"def {test}(" in file.read_text()
    elif path.startswith("tests/"):
        assert re.search(r"def test_", file.read_text()), "it tests something"
    else:
        for word in named.split()[1:]:
            assert word in file.read_text(), "a part of the script"


def test_every_builder_is_named_and_exists() -> None:
    readers = TEXT.split("What is promised per reader")[1].split("\n### ")[0]
    rows = [line for line in readers.splitlines() if line.startswith("|")]
    words = set(re.findall(r"`([a-z0-9_]+)`", " ".join(row.rsplit("|", 2)[1] for row in rows)))
    assert words == BUILT, "no other name stands in the last column"


def test_every_promise_names_what_shows_it() -> None:
    parts = TEXT.split("\n### ")
    for part in parts[1:]:
        for row in [line for line in part.splitlines() if line.startswith("|")][2:]:
            assert re.search(r"`(tests|scripts)/", row), row
