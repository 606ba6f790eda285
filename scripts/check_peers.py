"""Asks Gymnasium's ``check_env`` about our environment and about panda-gym's, and writes ``docs/results/peers.json``.

pip install --no-deps panda-gym==3.0.7 && python scripts/check_peers.py
"""

from __future__ import annotations

import importlib.metadata as metadata
import warnings
from pathlib import Path

import gymnasium as gym
import panda_gym  # noqa: F401  (registers its environments)
from gymnasium.utils.env_checker import check_env

import syda_gym  # noqa: F401
from syda_gym.files import write_json

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "peers.json"


def main() -> None:
    """Checks every environment and keeps what was said about it."""
    warnings.simplefilter("ignore")
    said = {name: verdict(name) for name in gym.registry if name.startswith(("Panda", "SydaTeleop"))}
    peers = {name: words for name, words in said.items() if name.startswith("Panda")}
    result = {
        "versions": {name: metadata.version(name) for name in ("gymnasium", "panda-gym")},
        "SydaTeleop-v0": said["SydaTeleop-v0"],
        "panda-gym": {"environments": len(peers), "passed": sum(not words for words in peers.values())},
        "said": {words: sum(other == words for other in peers.values()) for words in sorted(set(peers.values()))},
    }
    write_json(PAGE, result)
    print(result)


def verdict(name: str) -> str:
    """What ``check_env`` objects to; empty if nothing."""
    try:
        env = gym.make(name)
        check_env(env.unwrapped, skip_render_check=True)
        env.close()
    except Exception as error:
        return " ".join(f"{type(error).__name__}: {error}".split())[:120]
    return ""


if __name__ == "__main__":
    main()
