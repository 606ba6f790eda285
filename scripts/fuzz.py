"""Feeds damaged files and packets to everything that reads from outside, and reports what is not one of our exceptions.

    python scripts/fuzz.py [--inputs 100000] [--seconds 600] [--seed 0] [--only NAME] [--out docs/results/fuzz.json]

Every reader of motions, stored mappings, robot descriptions and URDFs, journals and network packets gets valid samples
that were cut, overwritten, repeated, mixed and sprinkled with nasty numbers. A reader may take what it gets or raise a
``SydaError``; anything else is a finding, as is an input that takes longer than the limit. Findings are kept beside the
results with the seed that made them.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import syda_gym
from syda_gym.embodiments import catalog
from syda_gym.embodiments.robot import Robot
from syda_gym.embodiments.urdf import read_urdf
from syda_gym.errors import SydaError
from syda_gym.files import asset, write_json
from syda_gym.motions.loading import FORMATS
from syda_gym.teleoperation.packets import PacketDecoder, encode_frame, encode_request

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from motions import paper_workbooks, recordings  # noqa: E402  (sample recordings are written by the tests' helpers)

LIMIT = 5.0  # s of processor time for one input
NASTY = (
    b"nan",
    b"inf",
    b"-1",
    b"1e308",
    b"99999999999",
    b"",
    b"\x00",
    b"null",
    b"[]",
    b"{}",
    b'"',
    b",",
    b"\n",
    b"\xff\xfe",
)


@dataclass(frozen=True)
class Target:
    """Something that reads: samples of what it likes, how it is called, and how soon it has had enough."""

    name: str
    samples: list[bytes]
    read: Callable[[bytes], Any]
    haste: float = 1.0


def main() -> int:
    """Runs all targets in turn until the inputs or the time are used up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seconds", type=float, default=600.0, help="stop after this time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="a part of the targets' names")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results" / "fuzz.json")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, _too_long)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the URDF parsers print what they dislike, from C++
    with tempfile.TemporaryDirectory() as folder:
        targets = [target for target in all_targets(Path(folder)) if options.only in target.name]
        counts, findings = run(targets, options.inputs, options.seconds, options.seed, options.out.parent)
    result = {
        "command": f"python scripts/fuzz.py --inputs {options.inputs} --seed {options.seed}",
        "inputs": sum(counts.values()),
        "by_target": counts,
        "findings": findings,
    }
    write_json(options.out, result)
    print(f"{result['inputs']} inputs, {len(findings)} findings: {options.out}")
    return 1 if findings else 0


def run(
    targets: list[Target], inputs: int, seconds: float, seed: int, folder: Path
) -> tuple[dict[str, int], list[dict[str, Any]]]:
    """Shares the time: a slow reader gets fewer inputs than a fast one.

    Returns:
        Inputs per target, and findings (at most one per kind of exception and line).
    """
    counts = dict.fromkeys((target.name for target in targets), 0)
    spent = dict.fromkeys(counts, 0.0)
    seen: set[tuple[str, str]] = set()
    findings: list[dict[str, Any]] = []
    start = time.monotonic()
    for number in range(inputs):
        if time.monotonic() - start > seconds:
            break
        target = min(targets, key=lambda one: spent[one.name] * one.haste)
        data = damaged(target.samples, np.random.default_rng([seed, number]))
        begin = time.monotonic()
        problem = attempt(target, data)
        spent[target.name] += time.monotonic() - begin
        counts[target.name] += 1
        if problem and (target.name, problem) not in seen:
            seen.add((target.name, problem))
            kept = folder / f"fuzz-{target.name}-{seed}-{number}.bin"
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(data)
            findings.append({"target": target.name, "number": number, "seed": seed, "problem": problem})
            print(f"{target.name}, input {number}: {problem}", flush=True)
    return counts, findings


def attempt(target: Target, data: bytes) -> str:
    """Reads once; empty if it went well or raised one of our exceptions."""
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        target.read(data)
    except SydaError:
        return ""
    except MemoryError:
        return "MemoryError"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)
        inside = [frame for frame in last if "syda_gym" in frame.filename]
        place = inside[-1] if inside else last[-1]
        return f"{type(error).__name__}: {str(error)[:120]} at {Path(place.filename).name}:{place.lineno}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return ""


def damaged(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """One sample with one to eight wounds."""
    data = bytearray(samples[rng.integers(len(samples))])
    for _ in range(int(rng.integers(1, 9))):
        size = max(len(data), 1)
        place = int(rng.integers(size))
        length = int(min(rng.geometric(0.05), size))
        kind = rng.integers(8)
        if kind == 0:
            del data[place:]  # cut off
        elif kind == 1:
            del data[place : place + length]
        elif kind == 2:
            data[place : place + length] = rng.integers(0, 256, length, dtype=np.uint8).tobytes()
        elif kind == 3 and data:
            data[place % len(data)] ^= 1 << int(rng.integers(8))
        elif kind == 4:
            data[place:place] = data[place : place + length] * int(rng.integers(1, 20))  # repeated
        elif kind == 5:
            data[place : place + int(rng.integers(0, 6))] = NASTY[rng.integers(len(NASTY))]
        elif kind == 6:
            other = samples[rng.integers(len(samples))]
            data[place:] = other[min(place, len(other)) :]  # mixed with another sample
        else:
            digits = [i for i in range(place, min(place + 200, len(data))) if 48 <= data[i] <= 57]
            if digits:  # another number where there was one
                at = digits[0]
                data[at : at + 1] = NASTY[rng.integers(5)]
    return bytes(data)


def all_targets(folder: Path) -> list[Target]:
    """Every target with its samples, written into ``folder``."""
    return [*motion_targets(folder), *mapping_targets(folder), *robot_targets(folder), *network_targets()]


def motion_targets(folder: Path) -> list[Target]:
    """Every format of ``load_motions``."""

    def file_target(name: str, files: list[Path]) -> Target:
        place = folder / f"damaged-{name}{files[0].suffix}"

        def read(data: bytes) -> Any:
            place.write_bytes(data)
            return FORMATS[name].read(place)

        return Target(f"motions-{name}", [file.read_bytes() for file in files], read)

    def text(name: str, content: str) -> Path:
        (folder / name).write_text(content)
        return folder / name

    tiny = syda_gym.load_motions("embedded", fps=2)
    few = syda_gym.Motions(tiny.name, tiny.takes[:2], tiny.bodies, tiny.families, synthetic=True)
    syda_gym.save_motions(few, folder / "few.npz")
    kinect = recordings.write_rows(folder / "kinect.csv", recordings.kinect_rows(12))
    openni = recordings.write_rows(folder / "openni.txt", recordings.openni_rows(12), separator=" ", end="")
    pose = {"fps": 25, "frames": recordings.mediapipe_json(4)}
    return [
        file_target("npz", [folder / "few.npz"]),
        file_target("kinect", [kinect]),
        file_target("openni", [openni, text("cornell.txt", "\n".join(recordings.cornell_lines(6)))]),
        file_target("bvh", [text("walk.bvh", recordings.bvh_text())]),
        file_target("mediapipe", [text("pose.json", recordings.json_text(pose))]),
        paper_target(folder),
    ]


def paper_target(folder: Path) -> Target:
    """A data set of small workbooks, one of which is damaged."""
    root = paper_workbooks.write_dataset(folder / "paper")
    victim = root / "Pepper2Human" / "human_P01A01T01.xlsx"

    def read(data: bytes) -> Any:
        victim.write_bytes(data)
        return FORMATS["paper"].read(root)

    return Target("motions-paper", [victim.read_bytes()], read)


def mapping_targets(folder: Path) -> list[Target]:
    """The two files of a stored mapping, damaged one at a time."""
    pair = syda_gym.load_motions("embedded", fps=2).pair("adult", "pepper")
    pair = pair.only_actions(pair.action_names[:4])
    for name, method in (("ridge", "ridge"), ("near", "nearest")):
        syda_gym.save_mapping(syda_gym.fit(pair, method=method, seed=0), folder / name)
    weights, card = folder / "ridge.safetensors", folder / "ridge.json"
    good = {path: path.read_bytes() for path in (weights, card)}

    def reader(path: Path) -> Callable[[bytes], Any]:
        def read(data: bytes) -> Any:
            path.write_bytes(data)
            try:
                return syda_gym.load_mapping(folder / "ridge")
            finally:
                path.write_bytes(good[path])

        return read

    return [
        Target("mapping-weights", [good[weights], (folder / "near.safetensors").read_bytes()], reader(weights)),
        Target("mapping-card", [good[card], (folder / "near.json").read_bytes()], reader(card)),
    ]


def robot_targets(folder: Path) -> list[Target]:
    """Robot descriptions and URDFs."""
    description = folder / "robot.yaml"
    urdf = folder / "robot.urdf"
    for name in ("nao.urdf", "pepper.urdf"):
        (folder / name).write_bytes(asset("robots", name).read_bytes())

    def read_description(data: bytes) -> Any:
        description.write_bytes(data)
        return Robot.read(description)

    def read_tree(data: bytes) -> Any:
        urdf.write_bytes(data)
        return read_urdf(urdf)

    return [
        Target(
            "robot-yaml", [asset("robots", f"{name}.yaml").read_bytes() for name in ("nao", "pepper")], read_description
        ),
        Target("robot-urdf", [asset("robots", "nao.urdf").read_bytes()], read_tree),
    ]


def network_targets() -> list[Target]:
    """Packets of the live sources, with and without a token."""
    body = catalog.get("adult")
    frame = np.linspace(-0.3, 0.3, body.n_features)
    samples = [
        encode_frame(1, 0.5, frame),
        encode_frame(2, 1.5, frame, token="secret", confidence=0.5),
        encode_request(3, 2.0, "pause"),
    ]
    return [
        Target("network-open", samples, PacketDecoder(body), haste=4.0),
        Target("network-token", samples, PacketDecoder(body, token="secret"), haste=4.0),
    ]


def _too_long(*_: object) -> None:
    raise TimeoutError(f"more than {LIMIT} s")


if __name__ == "__main__":
    sys.exit(main())
