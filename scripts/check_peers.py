"""Asks peers what they ask of us, in one process on one machine, and writes ``docs/results/peers.json``.

    python scripts/check_peers.py [--gmr CHECKOUT --bvh FILE.bvh ...]

Environments: what Gymnasium's ``check_env`` says of ours, of panda-gym's (`pip install --no-deps panda-gym==3.0.7`) and
of Humanoid-v5 (extra `mjcf`), and processor time of a step. Motions: the same frames, the same limbs, the same robot by
the unfitted mapping and by mink (extra `ik`); with ``--gmr`` the Unitree G1 by the method of a checkout of GMR
(``general_motion_retargeting``, with what it needs installed) and by the unfitted mapping, on BVH files of CMU's
skeleton. What is not installed or not named is not run, and what was not run is not printed.
"""

from __future__ import annotations

import argparse
import importlib.metadata as metadata
import importlib.util
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import syda_gym
from syda_gym.files import write_json
from syda_gym.motions.readers.bvh.hierarchy import read_hierarchy
from syda_gym.motions.readers.bvh.kinematics import joint_positions

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "peers.json"
ACTIONS = ("wave_high", "drum", "reach_high_front", "clap")
STEPS = 300
GMR_FPS = 30.0  # to which GMR brings motions of SMPL-X
CMU = {  # GMR's joints of SMPL-X, and CMU's at the same places
    "pelvis": "Hips",
    "spine3": "Spine1",
    **{
        f"{side}_{theirs}": f"{side.title()}{name}"
        for side in ("left", "right")
        for theirs, name in {
            "hip": "UpLeg",
            "knee": "Leg",
            "foot": "ToeBase",
            "shoulder": "Arm",
            "elbow": "ForeArm",
            "wrist": "Hand",
        }.items()
    },
}
Frames = NDArray[np.float64]


def main() -> None:
    """Runs what is there and keeps what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--gmr", type=Path, help="checkout of GMR")
    parser.add_argument("--bvh", type=Path, nargs="+", help="for --gmr: CMU's skeleton, a T-pose in the first frame")
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    result: dict[str, Any] = {"environments": environments(), "on Pepper": on_pepper()}
    if given.gmr is not None:
        if given.bvh is None:
            parser.error("--gmr needs --bvh FILE.bvh: GMR wants a whole skeleton with orientations")
        for file in given.bvh:
            result[f"on the Unitree G1, {file.stem}"] = on_unitree(given.gmr, file)
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
    sys.path.insert(0, str(checkout.resolve()))
    from general_motion_retargeting import GeneralMotionRetargeting, params  # type: ignore[import-not-found]

    clip = syda_gym.load_motions(f"bvh:{bvh}").clips("operator")[0]
    whole, every = len(clip), round(clip.fps / GMR_FPS)
    if every < 1:
        raise SystemExit(f"{bvh}: {clip.fps:g} frames per second; --gmr takes {GMR_FPS:g} or more")
    clip = replace(clip, frames=clip.frames[::every], fps=clip.fps / every)
    mapping: Any = syda_gym.unfitted(clip.body, str(params.ROBOT_XML_DICT["unitree_g1"]))
    ours = followed(mapping, [clip], lambda each: mapping.sequence(each.frames, each.fps))

    people, height = smpl_like(bvh, float(mapping.source.arm_lengths[0].sum()), whole, every)
    retarget = GeneralMotionRetargeting("smplx", "unitree_g1", actual_human_height=height, verbose=False)
    for _ in range(10):
        retarget.retarget(dict(people[0]))  # it begins settled
    kept: list[Any] = []
    seconds = spent(lambda: kept.extend(retarget.retarget(dict(frame)) for frame in people))
    poses, model, none = np.array(kept), retarget.model, np.array([], dtype=np.int64)
    angles = poses[:, [int(model.joint(name).qposadr[0]) for name in mapping.target.joint_names]]
    sides = ("left", "right")
    person = np.array(
        [
            [[frame[f"{side}_{part}"][0] for part in ("shoulder", "elbow", "wrist")] for side in sides]
            for frame in people
        ]
    )
    torso = Rotation.from_matrix(of_bodies(model, poses, ["torso_link"], "xmat").reshape(-1, 3, 3))
    same = np.einsum("nij,napj->napi", torso.as_matrix(), mapping.target.arm_points(angles))
    links = [f"{side}_{part}_link" for side in sides for part in ("shoulder_yaw", "elbow", "wrist_yaw")]
    own = of_bodies(model, poses, links, "xpos").reshape(-1, 2, 3, 3)
    return {
        "GMR, whole body": figures(person, same, angles, seconds, none),
        "GMR, between its links' frames": figures(person, own, angles, seconds, none),
        "unfitted, arms": ours,
    }


def of_bodies(model: Any, poses: Frames, names: list[str], what: str) -> Frames:
    """A quantity of bodies ``(N, bodies, ...)`` in the world, by MuJoCo."""
    import mujoco

    data, result = mujoco.MjData(model), []
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        result.append([getattr(data.body(name), what).copy() for name in names])
    return np.array(result)


def smpl_like(bvh: Path, arm: float, whole: int, every: int) -> tuple[list[dict[str, tuple[Frames, Frames]]], float]:
    """What GMR takes of SMPL-X, of a BVH file of CMU's skeleton whose first frame is a T-pose.

    SMPL-X turns every joint from a T-pose in which all axes are the world's; so does what is left of a joint's turn
    when that of the T-pose is taken out. y is up in the file and z in GMR.

    Args:
        bvh: the file.
        arm: length of its left arm [m], by which units become metres.
        whole: how many of the last frames are motion; a calibration pose before them is not.
        every: which of them are wanted.

    Returns:
        Per frame and joint the place [m] and the quaternion (w first), and the person's height [m].
    """
    text = read_hierarchy(bvh, bvh.read_text().splitlines())
    index = {joint.name: number for number, joint in enumerate(text.joints)}
    if missing := sorted(set(CMU.values()) - set(index)):
        raise SystemExit(f"{bvh}: --gmr takes CMU's skeleton; it has no {', '.join(missing)}")
    turns: list[Rotation] = []
    for joint in text.joints:
        turn = turns[joint.parent] if joint.parent >= 0 else Rotation.identity()
        for column, (axis, is_turn) in enumerate(joint.channels, start=joint.first):
            if is_turn:
                turn = turn * Rotation.from_rotvec(np.deg2rad(text.values[:, [column]]) * np.eye(3)[axis])
        turns.append(turn)
    places = joint_positions(text, range(len(text.joints)))
    rest = {name: places[number][0] for name, number in index.items()}
    across = rest["LeftHand"] - rest["RightHand"]
    if across[0] < 0.9 * float(np.linalg.norm(across)):
        raise SystemExit(f"{bvh}: --gmr takes files whose first frame is a T-pose that looks along +z, y up")
    lengths = [np.linalg.norm(rest[b] - rest[a]) for a, b in (("LeftArm", "LeftForeArm"), ("LeftForeArm", "LeftHand"))]
    metres = arm / float(sum(lengths))
    rows = np.arange(len(text.values) - whole, len(text.values), every)
    up = Rotation.from_euler("x", 90.0, degrees=True)
    found = {}
    for theirs, name in CMU.items():
        turn = up * turns[index[name]][rows] * turns[index[name]][0].inv()
        found[theirs] = (metres * up.apply(places[index[name]][rows]), turn.as_quat(scalar_first=True))
    tall = metres * float(max(p[1] for p in rest.values()) - min(p[1] for p in rest.values()))
    # The last joint is where the head begins: an eighth of a person is above it.
    return [{name: (p[n], q[n]) for name, (p, q) in found.items()} for n in range(len(rows))], 8.0 / 7.0 * tall


if __name__ == "__main__":
    main()
