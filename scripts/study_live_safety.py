"""How safe the live loop is: free targets reached, stops obeyed, and limits on the wire under load.

    python scripts/study_live_safety.py pairs --count 2000 --out docs/results/live_safety.json
    python scripts/study_live_safety.py stops --count 1000 --out docs/results/live_safety.json
    python scripts/study_live_safety.py wire --count 20000 --out docs/results/live_safety.json
    python scripts/study_live_safety.py people --data ../shared/data --out docs/results/live_safety.json
    python scripts/study_live_safety.py unfamiliar --data ../shared/data --out docs/results/live_safety.json

``pairs``: random pairs of free poses; the motion of the live loop goes from one to the other within 5 s at 30 Hz
(``--progress FOLDER`` keeps each pair's outcome, so that a run goes on where the last one ended).
``stops``: stops in random states of the loop. ``wire``: UDP to UDP in real time beside processes that keep the cores
busy, flood the source with junk and stop the loop's process now and then, with an emergency stop every ten seconds or
so; speeds and accelerations are taken from the kernel's time stamps of the packets. With ``--add`` the figures of a run
are added to those of earlier ones, so that many commands can be had in pieces. ``people``: how many frames of real
recordings are called implausible. ``unfamiliar``: how many frames of an action are called unfamiliar by a mapping
fitted on the same person's others.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import json
import math
import multiprocessing
import os
import signal
import socket
import struct
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.files import atomic_path
from syda_gym.mappings.fitting.fit import fit
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions.loading import load_motions
from syda_gym.simulation.collision.self_collision import SelfCollision
from syda_gym.teleoperation import LoopSettings, TeleoperationLoop, Tick, UdpSink, UdpSource, run
from syda_gym.teleoperation.calibration import Calibration
from syda_gym.teleoperation.incoming.packets import encode_frame, encode_request
from syda_gym.teleoperation.safety.limiter import CommandLimiter
from syda_gym.teleoperation.safety.motion import Motion
from syda_gym.teleoperation.safety.plausibility import Plausibility
from syda_gym.teleoperation.tick import State

DT = 1 / 30
_STAMP = 35  # SO_TIMESTAMPNS


def main() -> None:
    """Runs one part and writes its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["pairs", "stops", "wire", "people", "unfamiliar"])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--robots", nargs="+", default=["pepper", "nao"])
    parser.add_argument("--rate", type=float, default=60.0, help="of the loop on the wire [Hz]")
    parser.add_argument("--progress", type=Path, help="folder of outcomes of `pairs`; those in it are not run again")
    parser.add_argument("--seed", type=int, default=0, help="of the person on the wire")
    parser.add_argument("--add", action="store_true", help="add to the figures of `wire` that are there")
    parser.add_argument("--data", type=Path, help="folder of recordings for `people`")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    parts = {"pairs": pairs, "stops": stops, "wire": wire, "people": people, "unfamiliar": unfamiliar}
    result = parts[args.part](args)
    print(json.dumps(result, indent=2))
    if args.out is not None:
        known = json.loads(args.out.read_text()) if args.out.is_file() else {}
        if args.add and args.part in known:
            result = added(known[args.part], result)
        with atomic_path(args.out) as path:
            path.write_text(json.dumps({**known, args.part: result}, indent=2) + "\n")


def added(before: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """The figures of two runs on the wire together: counts add up, of times and shares the greatest counts."""
    result = {**now}
    for name, value in before.items():
        if isinstance(value, dict):
            result[name] = added(value, now.get(name, {}))
        elif name not in now:
            result[name] = value
        elif isinstance(value, int) or name == "moved_rad":
            result[name] = value + now[name]
        else:
            result[name] = max(value, now[name])
    return result


def pairs(args: argparse.Namespace) -> dict[str, Any]:
    """Targets reached by how they could be reached, violations, and the share that was not reached."""
    return {name: _pairs(_robot(name), args.count, args.progress) for name in args.robots}


def _pairs(robot: Robot, count: int, folder: Path | None) -> dict[str, Any]:
    known: dict[int, dict[str, Any]] = {}
    file = None if folder is None else folder / f"{robot.name}.jsonl"
    if file is not None and file.is_file():
        known = {row["pair"]: row for row in map(json.loads, file.read_text().splitlines())}
    tools = CommandLimiter(robot), SelfCollision(robot)
    for number in range(count):
        if number not in known:
            known[number] = _pair(robot, *tools, number)
            if file is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                with file.open("a") as stream:
                    stream.write(json.dumps(known[number]) + "\n")
    rows = [known[number] for number in range(count)]
    seconds = [row["seconds"] for row in rows if row["seconds"] is not None]
    kinds = {kind: [row for row in rows if row["kind"] == kind] for kind in ("straight", "over_rest", "neither")}
    wrong = np.sum([row["wrong"] for row in rows], axis=0)
    return {
        "pairs": count,
        **{
            f"{kind}_reached": f"{sum(row['seconds'] is not None for row in some)} of {len(some)}"
            for kind, some in kinds.items()
        },
        "not_reached_percent": 100.0 * (count - len(seconds)) / count,
        "seconds_p50": float(np.median(seconds)),
        "seconds_max": float(max(seconds)),
        **dict(
            zip(
                ("contacts", "limit_violations", "speed_violations", "acceleration_violations"),
                wrong.tolist(),
                strict=True,
            )
        ),
    }


def _pair(robot: Robot, limiter: CommandLimiter, plain: SelfCollision, number: int) -> dict[str, Any]:
    """One pair: how its goal could be reached, when it was, and how often a limit was broken or links touched."""
    acceleration, rng = limiter.speed / 0.2, np.random.default_rng([0, number])
    check = copy.copy(plain)  # what one pair measures is not the next one's
    check._clearance = copy.copy(plain._clearance)

    def free() -> FloatArray:
        while True:
            pose = robot.clamp(rng.uniform(robot.lower, robot.upper))[0]
            if not plain.touches(pose):
                return pose

    def line(start: FloatArray, end: FloatArray) -> bool:
        steps = math.ceil(float(np.abs(end - start).max()) / 0.05)
        poses = [start + (end - start) * (index / steps) for index in range(steps + 1)]
        return all(limiter.allows(pose) and not plain.touches(pose) for pose in poses)

    start, goal = free(), free()
    if line(start, goal):
        kind = "straight"
    else:
        kind = "over_rest" if line(start, robot.rest) and line(robot.rest, goal) else "neither"
    motion = Motion(limiter, check, DT, acceleration, None, start)
    motion.begin(0.0, None)
    motion.brake()
    before, velocity, took, wrong = motion.command, np.zeros(robot.n_features), None, np.zeros(4, dtype=int)
    for index in range(1, 151):
        motion.begin(index * DT, None)
        motion.follow(goal, 1.0)
        check.measure(motion.command)
        now = (motion.command - before) / DT
        wrong += [
            plain.touches(motion.command),
            int(robot.violations(motion.command, 0.0).sum()),
            int((np.abs(now) > robot.speed * (1 + 1e-12)).sum()),
            int((np.abs(now - velocity) > acceleration * DT * (1 + 1e-6)).sum()),
        ]
        before, velocity = motion.command, now
        if np.abs(motion.command - goal).max() < 1e-3:
            took = index * DT
            break
    return {"pair": number, "kind": kind, "seconds": took, "wrong": wrong.tolist()}


def stops(args: argparse.Namespace) -> dict[str, Any]:
    """Stops in random states: obeyed in the same tick, without one further step."""
    adult, robot = _adult(), _robot(args.robots[0])
    loop = TeleoperationLoop(unfitted(adult, robot), LoopSettings(calibration=0.0, hold=0.3))
    frames = np.concatenate([clip.frames for clip in load_motions("embedded").clips("adult")])
    rng, now, obeyed, states = np.random.default_rng(0), 0.0, 0, dict[str, int]()
    for _ in range(args.count):
        for _ in range(int(rng.integers(2, 40))):
            now += float(rng.choice([DT, DT, DT, 0.005, 0.7]))
            control = str(rng.choice(["", "pause", "resume", "calibrate", "rest"], p=[0.9, 0.02, 0.05, 0.01, 0.02]))
            frame = adult.standing() if rng.random() < 0.4 else frames[int(now * 30) % len(frames)]
            loop.step(Tick(now, None if rng.random() < 0.15 else frame, now, controls=(control,) if control else ()))
        states[loop.state.value] = states.get(loop.state.value, 0) + 1
        before, now = loop.command, now + DT
        decision = loop.step(Tick(now, frames[0], now, controls=("stop", str(rng.choice(["resume", "rest", "pause"])))))
        after = loop.step(Tick(now + DT, frames[1], now + DT, controls=("resume", "calibrate")))
        still = (decision.command == before).all() and (after.command == before).all()
        obeyed += bool(decision.state is State.STOPPED and after.state is State.STOPPED and still)
        now += 2 * DT
        loop.step(Tick(now, controls=("release",), position=robot.clamp(before + rng.normal(0, 0.05, len(before)))[0]))
        now += DT
        loop.step(Tick(now, controls=("resume",)))
    return {"stops": args.count, "obeyed_in_the_same_tick": obeyed, "states": states}


def wire(args: argparse.Namespace) -> dict[str, Any]:
    """Limits of commands by the time stamps of their packets, on busy cores, in a flood, with stalls."""
    robot, adult = _robot(args.robots[0]), _adult()
    loop = TeleoperationLoop(unfitted(adult, robot), LoopSettings(calibration=0.0, rate=args.rate))
    context, pipes = multiprocessing.get_context("spawn"), multiprocessing.Pipe()
    seconds = args.count / args.rate * 1.1
    with UdpSource(adult, port=0) as source:
        receiver = context.Process(target=_receive, args=(pipes[1], args.count))
        receiver.start()
        pipes[1].close()  # so that a receiver that died is noticed
        port = pipes[0].recv()
        others = [context.Process(target=_burn, args=(3 * seconds,)) for _ in range(os.cpu_count() or 1)]
        others.append(context.Process(target=_send, args=(source.port, args.rate, 3 * seconds, args.seed)))
        others.append(context.Process(target=_junk, args=(source.port, 3 * seconds)))
        others.append(context.Process(target=_stall, args=(os.getpid(), 3 * seconds)))
        for process in others:
            process.start()
        with UdpSink(robot, port=port) as sink:
            while receiver.is_alive() and not pipes[0].poll():
                run(source, loop, sink, seconds=1.0, rest_at_end=False)
            stamps, path, states = pipes[0].recv()
        for process in others:
            process.kill()
        receiver.join()
        dropped = dict(source.inbox.dropped)
    stopped = np.array([state == State.STOPPED.value for state in states])
    figures = _judge(robot, loop.acceleration, stamps, path, stopped)
    states = {state: states.count(state) for state in sorted(set(states))}
    return {
        "runs": 1,
        "rate_hz": args.rate,
        **figures,
        "states": states,
        "dropped": dropped,
        "load_average": os.getloadavg()[0],
    }


def _judge(robot: Robot, most: FloatArray, stamps: FloatArray, path: FloatArray, stopped: Any) -> dict[str, Any]:
    """What the wire saw: poses ``(N, n)`` at times ``(N,)``, and which of them were sent as stopped ``(N,)``."""
    dt = np.diff(stamps)
    step = np.diff(path, axis=0)
    velocity = step / dt[:, None]
    change = np.abs(np.diff(velocity, axis=0)) / (0.5 * (dt[1:] + dt[:-1]))[:, None] / most
    emergency = stopped[2:] & ~stopped[1:-1]  # no limit but the robot's own: not one step further
    faster = (np.abs(velocity[1:]) > np.abs(velocity[:-1])) & ~emergency[:, None]
    slower = ~faster & ~emergency[:, None]
    check = SelfCollision(robot)
    for row, joint in np.argwhere((change > 1.02) & ~emergency[:, None]):
        share = (velocity[row : row + 2, joint] / robot.speed[joint]).round(3).tolist()
        around = (1e3 * dt[max(row - 2, 0) : row + 3]).round(2).tolist()
        print(f"{change[row, joint]:.2f} of the limit at {row}: {share} of a joint's speed, intervals {around} ms")
    return {
        "commands": len(path),
        "limit_violations": int(robot.violations(path, 0.0).sum()),
        "speed_violations": int((np.abs(velocity) > robot.speed * 1.001).sum()),
        "acceleration_violations_getting_faster": int(((change > 1.02) & faster).sum()),
        "acceleration_violations_braking": int(((change > 1.02) & slower).sum()),
        "emergency_stops": int(emergency.sum()),
        "steps_while_stopped": int(step[stopped[1:]].any(axis=1).sum()),
        "greatest_speed_share": float((np.abs(velocity) / robot.speed).max()),
        "greatest_acceleration_share_getting_faster": float(np.where(faster, change, 0.0).max()),
        "greatest_acceleration_share_braking": float(np.where(slower, change, 0.0).max()),
        "greatest_acceleration_share_of_an_emergency_stop": float(change[emergency].max(initial=0.0)),
        "contacts_in_a_sample": sum(check.touches(pose) for pose in path[:: max(1, len(path) // 500)]),
        "moved_rad": float(np.abs(step).sum()),
        "interval_p50_ms": 1e3 * float(np.median(dt)),
        "interval_p99_ms": 1e3 * float(np.percentile(dt, 99)),
        "interval_max_ms": 1e3 * float(dt.max()),
    }


def _receive(pipe: Any, count: int) -> None:
    with contextlib.suppress(OSError, AttributeError):
        os.nice(-5)
    stamps, path, states, base = list[float](), list[list[float]](), list[str](), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        sock.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
        pipe.send(sock.getsockname()[1])
        while len(path) < count:
            data, extra, _, _ = sock.recvmsg(65_536, 1024)
            full, nanoseconds = struct.unpack("ll", extra[0][2][:16])
            base = base or full  # small numbers have finer steps
            stamps.append(full - base + 1e-9 * nanoseconds)
            content = json.loads(data)
            path.append(list(content["joints"].values()))
            states.append(str(content["state"]))
    pipe.send((np.array(stamps), np.array(path), states))


def _send(port: int, rate: float, seconds: float, seed: int) -> None:
    """Frames of somebody who throws the arms about, some of them lost, doubled or late; stops, and goes on."""
    adult, rng = _adult(), np.random.default_rng(seed)
    limbs = rng.normal(size=(2, 2, 3))
    index, end = 0, time.monotonic() + seconds
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while time.monotonic() < end:
            limbs += rng.normal(scale=0.15, size=limbs.shape)
            if rng.random() < 0.01:
                limbs = rng.normal(size=limbs.shape)
            unit = limbs / np.linalg.norm(limbs, axis=-1, keepdims=True) * adult.arm_lengths[..., None]
            points = np.repeat(adult.arm_points(adult.standing())[:, :, :1], 3, axis=2)
            points[0, :, 1:] += np.cumsum(unit, axis=1)
            packet = encode_frame(index, time.monotonic(), adult.frames_from_points(points)[0])
            for _ in range(int(rng.choice([0, 1, 2], p=[0.1, 0.8, 0.1]))):
                sock.sendto(packet, ("127.0.0.1", port))
            index += 1
            for chance, controls in ((0.1, ("stop", "release", "resume")), (1.0, ("resume",))):
                for control in controls if rng.random() < chance / rate else ():
                    sock.sendto(encode_request(index, time.monotonic(), control), ("127.0.0.1", port))
                    index += 1
                    time.sleep(0.2 if len(controls) > 1 else 0.0)
            time.sleep(float(rng.exponential(0.5) + 0.5) / rate if rng.random() > 0.002 else 0.5)


def _junk(port: int, seconds: float) -> None:
    junk, end = [b"[" * 16_000, b'{"v":1,"seq":5,"t":1,"frame":[NaN]}', b"\xff" * 40], time.monotonic() + seconds
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while time.monotonic() < end:
            for one in junk * 10:
                with contextlib.suppress(OSError):
                    sock.sendto(one, ("127.0.0.1", port))
            time.sleep(0.002)


def _burn(seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        sum(range(10_000))


def _stall(process: int, seconds: float) -> None:
    """Stops a process now and then for up to a second, as a suspended laptop or a paging system would."""
    rng, end = np.random.default_rng(1), time.monotonic() + seconds
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < end:
            time.sleep(float(rng.uniform(1.0, 5.0)))
            os.kill(process, signal.SIGSTOP)
            time.sleep(float(rng.choice([0.02, 0.1, 1.0])))
            os.kill(process, signal.SIGCONT)


def people(args: argparse.Namespace) -> dict[str, Any]:
    """Frames of real recordings that are dropped or slowed as implausible, by recording and reason."""
    result: dict[str, Any] = {"frames": 0, "doubted": 0}
    sources = ["embedded"] if args.data is None else sorted(map(str, args.data.glob("[kb]*/*.*")))
    for spec in sources:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            motions = load_motions(spec)
        for name, body in motions.bodies.items():
            if isinstance(body, HumanSkeleton) and len(body.sides) == 2:
                for clip in motions.clips(name):
                    _watch(body, clip, result)
    return result


def unfamiliar(args: argparse.Namespace) -> dict[str, Any]:
    """Shares of frames called unfamiliar: of each action by a fit of the others, and of all by a fit of all."""
    motions, result = load_motions(f"paper:{args.data / 'paper'}"), {}
    for person in ("adult", "kid"):
        pair = motions.pair(person, "pepper")
        held_out = [float(fit(train).unfamiliar(test.source).mean()) for train, test in pair.folds("loao")]
        result[person] = {
            "actions": len(held_out),
            "held_out_mean": float(np.mean(held_out)),
            "held_out_worst": max(held_out),
            "of_the_fit_itself": float(fit(pair).unfamiliar(pair.source).mean()),
            "unfitted": float(unfitted(pair.source_body, pair.target_body).unfamiliar(pair.source).mean()),
        }
    return result


def _watch(body: HumanSkeleton, clip: Any, result: dict[str, Any]) -> None:
    points = body.arm_points(clip.frames)
    calibration = Calibration(
        _adult(),
        lengths=np.median(np.linalg.norm(np.diff(points, axis=2), axis=-1), axis=0),
        width=float(np.median(np.linalg.norm(points[:, 0, 0] - points[:, 1, 0], axis=-1))),
        axes="ros",
    )
    times = np.arange(len(clip)) / clip.fps if clip.timestamps is None else clip.timestamps
    judge, before = Plausibility(calibration).judge, times[0]
    for index in range(0, len(clip), max(1, round(clip.fps / 30))):
        verdict = judge(np.ascontiguousarray(points[index].reshape(-1)), float(times[index] - before))
        before = times[index]
        result["frames"] += 1
        if verdict.reason:
            result["doubted"] += 1
            result[verdict.reason] = result.get(verdict.reason, 0) + 1


def _robot(name: str) -> Robot:
    robot = catalog.get(name)
    assert isinstance(robot, Robot)
    return robot


def _adult() -> HumanSkeleton:
    body = catalog.get("adult")
    assert isinstance(body, HumanSkeleton)
    return body


if __name__ == "__main__":
    main()
