"""Asks peers what they ask of us, in one process on one machine, and writes ``docs/results/peers.json``.

    python scripts/check_peers.py [--gmr CHECKOUT --bvh FILE.bvh]

Environments: what Gymnasium's ``check_env`` says of ours, of panda-gym's (`pip install --no-deps panda-gym==3.0.7`) and
of Humanoid-v5 (extra `mjcf`), and processor time of a step. Motions: the same frames, the same limbs, the same robot by
the unfitted mapping and by mink (extra `ik`); with ``--gmr`` the Unitree G1 by the method of a checkout of GMR
(``general_motion_retargeting``, with what it needs installed) and by the unfitted mapping, on a BVH file of LAFAN1's
skeleton. What is not installed or not named is not run, and what was not run is not printed.
"""

from __future__ import annotations

import argparse
import importlib.metadata as metadata
import importlib.util
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

import syda_gym
from syda_gym.files import write_json

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "peers.json"
ACTIONS = ("wave_high", "drum", "reach_high_front", "clap")
STEPS = 300
Frames = NDArray[np.float64]


def main() -> None:
    """Runs what is there and keeps what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--gmr", type=Path, help="checkout of GMR")
    parser.add_argument("--bvh", type=Path, help="motion capture with LAFAN1's skeleton, for --gmr")
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    result: dict[str, Any] = {"environments": environments(), "on Pepper": on_pepper()}
    if given.gmr is not None:
        if given.bvh is None:
            parser.error("--gmr needs --bvh FILE.bvh: GMR wants a whole skeleton with orientations")
        result["on the Unitree G1"] = on_unitree(given.gmr, given.bvh)
    names = ("syda-gym", "gymnasium", "panda-gym", "mujoco", "mink", "pybullet")
    result["versions"] = {name: version for name in names if (version := installed(name))}
    write_json(given.out, result)
    for part, rows in result.items():
        print(f"\n{part}")
        for name, row in rows.items():
            print(f"  {name:34} {row}")


def installed(name: str) -> str:
    """Its version, or nothing."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def spent(job: Callable[[], object]) -> float:
    """Processor time [s]: other work may share the machine."""
    before = time.process_time()
    job()
    return time.process_time() - before


def environments() -> dict[str, Any]:
    """Ours, and those of peers that are installed: what ``check_env`` objects to, and microseconds of a step."""
    found: dict[str, Any] = {name: asked(name) for name in gym.registry if name.startswith("SydaTeleop")}
    if importlib.util.find_spec("panda_gym"):
        import panda_gym  # noqa: F401  (registers its environments)

        rows = {name: asked(name) for name in gym.registry if name.startswith("Panda")}
        said = [row["objection"] for row in rows.values()]
        found["panda-gym"] = {
            "environments": len(rows),
            "passed": said.count(""),
            "objections": {words: said.count(words) for words in sorted(set(said) - {""})},
            "step_us": float(np.median([row["step_us"] for row in rows.values() if "step_us" in row] or [np.nan])),
        }
    if importlib.util.find_spec("mujoco"):
        found["Humanoid-v5"] = asked("Humanoid-v5")
    return found


def asked(name: str) -> dict[str, Any]:
    """One environment's objection, empty if there is none, and the time of a step without a picture."""
    row: dict[str, Any] = {"objection": ""}
    try:
        env = gym.make(name)
    except Exception as error:
        return {"objection": in_one_line(error)}
    try:
        check_env(env.unwrapped, skip_render_check=True)
    except Exception as error:
        row["objection"] = in_one_line(error)
    try:
        env.reset(seed=0)
        env.action_space.seed(0)
        actions = [env.action_space.sample() for _ in range(STEPS)]

        def play() -> None:
            for action in actions:
                _, _, terminated, truncated, _ = env.step(action)
                if terminated or truncated:
                    env.reset()

        play()  # once for what is compiled or loaded at first use
        row["step_us"] = 1e6 * spent(play) / STEPS
    except Exception as error:
        row["objection"] = row["objection"] or in_one_line(error)
    env.close()
    return row


def in_one_line(error: Exception) -> str:
    """An objection that a page can show."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:120]


def on_pepper() -> dict[str, Any]:
    """The same clips of the embedded adult on Pepper, limbs as they point, by the unfitted mapping and by mink."""
    clips = [clip for clip in syda_gym.load_motions("embedded").clips("adult") if clip.action in ACTIONS]
    ours: Any = syda_gym.unfitted("adult", "pepper")
    rows = {
        "unfitted, in sequence": followed(ours, clips, lambda clip: ours.sequence(clip.frames, clip.fps)),
        "unfitted, single frames": followed(ours, clips, lambda clip: ours(clip.frames)),
    }
    if importlib.util.find_spec("mink") and importlib.util.find_spec("daqp"):
        from syda_gym.mappings.coded_mapping import CodedMapping
        from syda_gym.mappings.coding.mink_ik import MinkArmCoder

        coder = MinkArmCoder(ours.target, ours.target_coder.settings(), ours.target_coder.arrays())
        theirs = CodedMapping(ours.card, ours.source_coder, coder, ours.regressor)
        # Warm-started from frame to frame, from rest at the beginning of each clip, without joint speeds.
        rows["mink, the same limb directions"] = followed(theirs, clips, lambda clip: theirs(clip.frames))
    return rows


def followed(mapping: Any, clips: list[Any], solve: Callable[[Any], Frames]) -> dict[str, float]:
    """Limb angle [degrees], frames per second of processor time, and the largest joint step [rad], over all clips."""
    solve(clips[0])  # compiled and loaded
    kept: list[Frames] = []
    seconds = spent(lambda: kept.extend(solve(clip) for clip in clips))
    person = np.concatenate([mapping.source.arm_points(clip.frames) for clip in clips])
    angles = np.concatenate(kept)
    seams = np.cumsum([len(clip) for clip in clips])[:-1] - 1
    return figures(person, mapping.target.arm_points(angles), angles, seconds, seams)


def figures(
    person: Frames, robot: Frames, angles: Frames, seconds: float, seams: NDArray[np.int64]
) -> dict[str, float]:
    """What can be told of any robot that follows.

    Args:
        person: shoulder, elbow and wrist ``(N, arms, 3, 3)``.
        robot: the same of the robot.
        angles: joint angles of its arms ``(N, n)`` [rad].
        seconds: of processor time for all frames.
        seams: last frames of clips, after which a step is no step.
    """
    a, b = np.diff(person, axis=2), np.diff(robot, axis=2)
    cosine = np.sum(a * b, axis=-1) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1))
    steps = np.delete(np.abs(np.diff(angles, axis=0)).max(axis=1), seams)
    return {
        "frames": len(angles),
        "limb_angle_deg": float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).mean()),
        "frames_per_second": len(angles) / seconds,
        "largest_step_rad": float(steps.max()),
    }


def on_unitree(checkout: Path, bvh: Path) -> dict[str, Any]:
    """The arms of the Unitree G1: GMR's whole-body method, and the unfitted mapping on the same frames."""
    import sys

    sys.path.insert(0, str(checkout.resolve()))
    from general_motion_retargeting import GeneralMotionRetargeting, params  # type: ignore[import-not-found]
    from general_motion_retargeting.utils.lafan1 import load_bvh_file  # type: ignore[import-not-found]

    people, height = load_bvh_file(str(bvh))
    names = [["LeftArm", "LeftForeArm", "LeftHand"], ["RightArm", "RightForeArm", "RightHand"]]
    person = np.array([[[frame[joint][0] for joint in arm] for arm in names] for frame in people], dtype=np.float64)
    retarget = GeneralMotionRetargeting("bvh_lafan1", "unitree_g1", actual_human_height=height, verbose=False)
    model = retarget.model
    kept: list[Any] = []
    seconds = spent(lambda: kept.extend(retarget.retarget(dict(frame)) for frame in people))
    poses, points = np.array(kept), robot_points(model, np.array(kept))
    joints = [
        j for j in range(model.njnt) if any(part in model.joint(j).name for part in ("shoulder", "elbow", "wrist"))
    ]
    columns = [int(model.jnt_qposadr[j]) for j in joints]
    # Both are compared in the trunk's own axes: GMR turns the whole robot with the person.
    gmr = figures(in_trunk(person), in_trunk(points), poses[:, columns], seconds, np.array([], dtype=np.int64))
    rows: dict[str, Any] = {"GMR, whole body": gmr}
    motions = syda_gym.load_motions(f"bvh:{bvh}")
    clip = motions.clips("operator")[0]
    mapping: Any = syda_gym.unfitted(clip.body, str(params.ROBOT_XML_DICT["unitree_g1"]))
    rows["unfitted, arms"] = followed(mapping, [clip], lambda each: mapping.sequence(each.frames, each.fps))
    return rows


def robot_points(model: Any, poses: Frames) -> Frames:
    """Shoulder, elbow and wrist of the G1 ``(N, 2, 3, 3)`` [m], by MuJoCo."""
    import mujoco

    data, result = mujoco.MjData(model), []
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        result.append(
            [
                [data.body(f"{side}_{part}_link").xpos.copy() for part in ("shoulder_yaw", "elbow", "wrist_yaw")]
                for side in ("left", "right")
            ]
        )
    return np.array(result)


def in_trunk(points: Frames) -> Frames:
    """Points in axes of their own shoulders: y from right to left, z up, so that headings do not count."""
    across = points[:, 0, 0] - points[:, 1, 0]
    across = across * np.array([1.0, 1.0, 0.0])
    y = across / np.linalg.norm(across, axis=-1, keepdims=True)
    z = np.broadcast_to(np.array([0.0, 0.0, 1.0]), y.shape)
    axes = np.stack([np.cross(y, z), y, z], axis=1)
    result: Frames = np.einsum("nij,napj->napi", axes, points)
    return result


if __name__ == "__main__":
    main()
