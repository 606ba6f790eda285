"""Tries a wheel in an empty environment, outside the checkout: commands, an episode, and what each missing extra says.

    python -m build --wheel && python scripts/check_wheel.py dist/syda_gym-*.whl [--keep FOLDER]

A new virtual environment gets PyTorch for the CPU and the wheel, nothing else. ``--keep`` names its folder, which is
used again if it exists. Prints sizes and minutes; exit code 1 if anything failed.
"""

from __future__ import annotations

import argparse
import ast
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TORCH = "torch==2.13.0"
EPISODE = """
import gymnasium, syda_gym
env = gymnasium.make("SydaTeleop-v0")
observation, info = env.reset(seed=0)
steps, done = 0, False
while not done:
    _, _, terminated, truncated, info = env.step(0 * env.action_space.sample())
    steps, done = steps + 1, terminated or truncated
print(f"{steps} steps of {info['motion']} over {info['route']}")
"""
COMMANDS = (
    ["syda-gym", "--version"],
    ["syda-gym", "--help"],
    ["syda-gym", "motions", "info", "embedded"],
    ["syda-gym", "robot", "list"],
    ["python", "-c", EPISODE],
)


def main() -> int:
    """Makes the environment, runs everything, and says what failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--keep", type=Path, help="folder of the environment")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch) / "environment"
        if not (folder / "bin" / "python").exists():
            install(folder, given.wheel.resolve())
        failed = [words for words in COMMANDS if not ran(folder, words, Path(scratch))]
        silent = [extra for extra, code in features().items() if not names_itself(folder, extra, code, Path(scratch))]
    for words in failed:
        print(f"FAILED: {' '.join(words)[:100]}")
    for extra in silent:
        print(f"FAILED: without the extra {extra!r} its feature does not name it")
    print(f"{len(COMMANDS) - len(failed)} of {len(COMMANDS)} commands ran; {len(features()) - len(silent)} of "
          f"{len(features())} missing extras name themselves")  # fmt: skip
    return 1 if failed or silent else 0


def install(folder: Path, wheel: Path) -> None:
    """An environment with the wheel."""
    venv.create(folder, with_pip=True)
    for what in (TORCH, str(wheel)):
        start = time.monotonic()
        subprocess.run([folder / "bin" / "python", "-m", "pip", "install", "--quiet", what], check=True)
        size = sum(path.lstat().st_size for path in folder.rglob("*")) / 1e9
        print(f"{Path(what).name}: {(time.monotonic() - start) / 60:.1f} minutes; the environment has {size:.2f} GB")


def features() -> dict[str, str]:
    """Extra to code that needs it, as the tests know them."""
    tree = ast.parse((ROOT / "tests" / "test_extras.py").read_text())
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "FEATURES":
            return {extra: code for extra, (_, code) in ast.literal_eval(node.value).items()}
    raise SystemExit("tests/test_extras.py has no FEATURES")


def names_itself(folder: Path, extra: str, code: str, place: Path) -> bool:
    """Whether a feature whose package is not there says which extra brings it."""
    program = (
        f"from syda_gym.errors import MissingExtraError\ntry:\n    exec({code!r})\n"
        "except MissingExtraError as error:\n    print(error)"
    )
    done = called(folder, ["python", "-c", program], place)
    named = f"pip install 'syda-gym[{extra}]'" in done.stdout
    if not named:
        print(f"{extra}: {done.stdout[-200:]}{done.stderr[-300:]}", file=sys.stderr)
    return named


def ran(folder: Path, words: list[str], place: Path) -> bool:
    """Runs a command and prints its last line."""
    done = called(folder, words, place)
    said = (done.stdout.strip() or done.stderr.strip()).splitlines()[-1:]
    print(f"{' '.join(words).strip()[:60].splitlines()[0]}: {' '.join(said)[:100]}")
    return done.returncode == 0


def called(folder: Path, words: list[str], place: Path) -> subprocess.CompletedProcess[str]:
    """A program of the environment, from another folder than the checkout."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"OMP_NUM_THREADS": "1", "SYDA_GYM_HOME": str(place / "home")}
    command = [str(folder / "bin" / words[0]), *words[1:]]
    return subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False)


if __name__ == "__main__":
    sys.exit(main())
