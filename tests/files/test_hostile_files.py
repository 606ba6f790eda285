"""Files built to hurt, of every kind that the fuzzer knows: our own error within 5 s and 1 GB, whatever reads them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from fuzz_build import BUILDERS  # noqa: E402

PAIRS = [f"{target} {build.__name__}" for target, builders in BUILDERS.items() for build in builders]
NEEDS = {"agent-onnx onnx_cards": ("onnx", "onnxruntime")}
# What a builder makes that is small enough after all, or merely odd, may be read; the others never.
MAY_BE_READ = {
    "urdf_chain",
    "urdf_star",
    "urdf_odd",
    "odd_clock",
    "deep_json",
    "other_types",
    "card_sizes",
    "other_sizes",
    "card_numbers",
    "workbook_strings",
    "mapping-weights-marked zero_spreads",  # where zeros are points and not spreads; of an agent they are never read
}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One process reads them all, with a limit on its memory and on the time of each input."""
    out = tmp_path_factory.mktemp("hostile") / "each.json"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(ROOT / "scripts" / "fuzz.py"), "--each", "2", "--out", str(out)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert out.is_file(), f"the process ended with {done.returncode}: {done.stdout[-2000:]}"
    result: dict[str, Any] = json.loads(out.read_text())
    return result


@pytest.mark.parametrize("pair", PAIRS)
def test_built_files_are_refused_in_our_words(outcomes: dict[str, Any], pair: str) -> None:
    for module in NEEDS.get(pair, ()):
        pytest.importorskip(module)
    entry = outcomes[pair]
    assert entry["inputs"] == 2
    assert entry["findings"] == []
    if not {pair, pair.split()[1]} & MAY_BE_READ:
        assert entry["read"] == 0
