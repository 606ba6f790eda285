"""Fixtures that every room shares."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import pytest

# The same examples in every run: a red test means a changed program, not other luck. Search wider with
# `pytest --hypothesis-profile=default`.
hypothesis.settings.register_profile("same-every-time", derandomize=True)
hypothesis.settings.load_profile("same-every-time")


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Folder with recordings and robot facts; they have no licence to be shipped, so it may be absent."""
    default = Path(__file__).resolve().parents[1].parent / "shared"
    folder = Path(os.environ.get("SYDA_GYM_SHARED", default))
    if not folder.is_dir():
        pytest.skip(f"SKIPPED LOUDLY: no folder {folder}; set SYDA_GYM_SHARED to test on real recordings")
    return folder


@pytest.fixture(scope="session")
def paper_dir(shared_dir: Path) -> Path:
    """The paper's recordings."""
    folder = shared_dir / "data" / "paper"
    if not folder.is_dir():
        pytest.skip(f"SKIPPED LOUDLY: no folder {folder}; the paper's recordings are needed")
    return folder
