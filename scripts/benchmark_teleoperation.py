"""Measures live teleoperation against its bars: latency, speed against mink, violations, a bad network, memory.

    python scripts/benchmark_teleoperation.py latency --frames 10000 --rate 30
    python scripts/benchmark_teleoperation.py throughput
    python scripts/benchmark_teleoperation.py timing            both, with 3000 frames: below three minutes; prints
                                                                the lines of docs/live.md
    python scripts/benchmark_teleoperation.py violations --data FOLDER
    python scripts/benchmark_teleoperation.py network --hours 1
    python scripts/benchmark_teleoperation.py fuzz --inputs 1000000

``FOLDER`` holds ``paper``, ``kinect`` and ``bvh``. Every part prints one JSON object, and ``--out FILE`` puts it into a
results file beside the other parts. Pin the process to one core, for example with ``taskset -c 1``; on a busy machine
``chrt -f 20`` gives it real-time priority.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import socket
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import syda_gym
from syda_gym import unfitted
from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.files import read_json, write_json
from syda_gym.mappings.mapping import Mapping
from syda_gym.motions.clip import MotionClip
from syda_gym.motions.loading import load_motions
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.teleoperation import LoopSettings, TeleoperationLoop, Tick, UdpSink, UdpSource, run
from syda_gym.teleoperation.incoming.inbox import Inbox
from syda_gym.teleoperation.incoming.ordering import Ordering
from syda_gym.teleoperation.incoming.packets import PacketDecoder, PacketError, encode_frame
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.live_statistics import LiveStatistics


def main() -> None:
    """Runs the part that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["latency", "throughput", "timing", "violations", "network", "fuzz"])
    parser.add_argument("--frames", type=int, help="of latency (10000) and timing (3000)")
    parser.add_argument("--rate", type=float, default=30.0)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--mapping", default="syda")
    parser.add_argument("--route", default="auto", help="auto, or bodies such as adult,kid,pepper")
    parser.add_argument("--out", type=Path, help="results file, in which this part is replaced")
    args = parser.parse_args()
    args.frames = args.frames or (3_000 if args.part == "timing" else 10_000)
    parts = {
        "latency": latency,
        "throughput": throughput,
        "violations": violations,
        "network": network,
        "fuzz": fuzz,
    }
    asked = ["throughput", "latency"] if args.part == "timing" else [args.part]
    result = {part: parts[part](args) for part in asked}
    print(json.dumps(result, indent=1))
    if args.part == "timing":
        print(page(result["throughput"], result["latency"]))
    if args.out is not None:
        before = read_json(args.out) if args.out.exists() else {}
        write_json(args.out, {**before, **result})


def page(steps: dict[str, Any], wire: dict[str, Any]) -> str:
    """The table and the paragraph of docs/live.md."""
    titles = {
        "syda adult>pepper": "SyDa, adult to Pepper",
        "syda adult>kid>pepper": "SyDa, chain over the kid",
        "geometric": "geometric",
        "mink": "mink IK in the same loop",
    }
    lines = [
        "| mapping | frames per second | median [ms] | free / held back [ms] | 99 % [ms] | times mink |",
        "|---|---|---|---|---|---|",
    ]
    for name, title in titles.items():
        row = steps[name]
        times = f"{row['times_mink']:.1f}" if "times_mink" in row else ""
        lines.append(
            f"| {title} | {row['frames_per_second']:.0f} | {row['p50_ms']:.2f} | {row['p50_free_ms']:.2f} / "
            f"{row['p50_held_back_ms']:.2f} | {row['p99_ms']:.2f} | {times} |"
        )
    lines.append(
        f"\nUDP to UDP over loopback in real time at 30 Hz, {wire['frames']} frames acted on, load average "
        f"{wire['load_average']:.1f}: median {wire['latency_p50_ms']:.2f} ms, 90 % {wire['latency_p90_ms']:.2f} ms, "
        f"99 % {wire['latency_p99_ms']:.2f} ms, worst {wire['latency_max_ms']:.0f} ms; from the sending of a frame to "
        f"its command back at the sender {wire['round_trip_p50_ms']:.2f} ms in the middle."
    )
    return "\n".join(lines)


def chosen(args: argparse.Namespace) -> Mapping:
    """The mapping that the arguments name."""
    route = "auto" if args.route == "auto" else tuple(args.route.split(","))
    return choose_mapping("adult", "pepper", mapping=args.mapping, route=route, motions="embedded")[0]


def operator_frames(count: int) -> FloatArray:
    """Frames of the embedded adult, as many as wanted."""
    frames = np.concatenate([clip.frames for clip in load_motions("embedded").clips("adult")])
    return frames[np.arange(count) % len(frames)]


def latency(args: argparse.Namespace) -> dict[str, Any]:
    """UDP to UDP over loopback in real time; another process is camera and robot and measures round trips."""
    mapping = chosen(args)
    loop = TeleoperationLoop(mapping, LoopSettings(rate=args.rate))
    standing, frames = standing_frames(args.rate), operator_frames(args.frames)
    stats = LiveStatistics(window=args.frames)  # the standing before them is forgotten
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    with UdpSource(mapping.source, port=0) as source:
        other = context.Process(
            target=_camera_and_robot, args=(theirs, source.port, np.concatenate([standing, frames]), args.rate)
        )
        other.start()
        with UdpSink(loop.robot, port=ours.recv()) as sink:
            ours.send("go")
            began, used = time.monotonic(), time.process_time()
            seconds = (len(standing) + len(frames)) / args.rate + 1.0
            run(source, loop, sink, statistics=stats, seconds=seconds, rest_at_end=False)
            share = (time.process_time() - used) / (time.monotonic() - began)
        trips = np.array(ours.recv())[len(standing) :]
        other.join()
    return {
        "route": mapping.route,
        "method": mapping.method,
        "rate_hz": args.rate,
        "cores": len(os.sched_getaffinity(0)),
        "load_average": os.getloadavg()[0],
        "latency_p90_ms": 1e3 * stats.percentile(90),
        "round_trip_p50_ms": 1e3 * float(np.nanpercentile(trips, 50)),
        "round_trip_p99_ms": 1e3 * float(np.nanpercentile(trips, 99)),
        "round_trips_missed": int(np.isnan(trips).sum()),
        "share_of_a_core": share,
        **stats.summary(),
    }


def standing_frames(rate: float) -> FloatArray:
    """The embedded adult standing for half a second longer than the calibration takes."""
    body = catalog.get("adult")
    assert isinstance(body, HumanSkeleton)
    return np.repeat(body.standing()[None], int(2.5 * rate), axis=0)


def _camera_and_robot(connection: Any, port: int, frames: FloatArray, rate: float) -> None:
    """Sends frames and waits for the command after each; a round trip that took too long is NaN."""
    # Camera and robot have their own processors; the loop keeps the one that it was given.
    others = set(range(os.cpu_count() or 1)) - os.sched_getaffinity(0)
    os.sched_setaffinity(0, others or os.sched_getaffinity(0))
    trips = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        connection.send(sock.getsockname()[1])
        connection.recv()
        begun = time.monotonic()
        for index, frame in enumerate(frames):
            packet = encode_frame(index, index / rate, frame)
            time.sleep(max(0.0, begun + index / rate - time.monotonic()))
            _drain(sock)
            sent = time.monotonic()
            sock.sendto(packet, ("127.0.0.1", port))
            sock.settimeout(0.9 / rate)
            try:
                sock.recv(65_536)
                trips.append(time.monotonic() - sent)
            except TimeoutError:
                trips.append(float("nan"))
    connection.send(trips)


def _drain(sock: socket.socket) -> None:
    """Throws away commands that no frame has led to."""
    sock.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            sock.recv(65_536)


def throughput(args: argparse.Namespace) -> dict[str, Any]:
    """Frames per second of the whole loop with different mappings; mink is the rival."""
    from syda_gym.mappings.fitting.fit import fit

    frames, standing = operator_frames(600), standing_frames(30.0)
    pair = load_motions("embedded", fps=5.0).pair("adult", "pepper")
    mappings = {
        "syda adult>pepper": choose_mapping("adult", "pepper", motions="embedded")[0],
        "syda adult>kid>pepper": choose_mapping(
            "adult", "pepper", route=("adult", "kid", "pepper"), motions="embedded"
        )[0],
        "geometric": unfitted(syda_gym.embodiment("adult"), syda_gym.embodiment("pepper")),
        "mink": fit(pair, method="mink"),
    }
    result: dict[str, Any] = {"load_average": os.getloadavg()[0]}
    for name, mapping in mappings.items():
        spent, held = [], []
        loop = TeleoperationLoop(mapping)
        clocks = _clocks(loop)
        for index, frame in enumerate(standing):
            loop.step(Tick(index / 30.0, frame, index / 30.0))
            loop.settle()
        for clock in clocks.values():
            clock.clear()
        for index, frame in enumerate(frames, start=len(standing)):
            tick = Tick(index / 30.0, frame, index / 30.0)
            before = time.thread_time()  # of this thread alone, so that other processes do not count
            decision = loop.step(tick)
            spent.append(time.thread_time() - before)
            loop.settle()  # as the driver does once the command is out
            held.append(any(reason.startswith("self-collision") for reason in decision.reasons))
        result[name] = {
            "frames_per_second": len(spent) / sum(spent),
            "p50_ms": 1e3 * float(np.percentile(spent, 50)),
            "p99_ms": 1e3 * float(np.percentile(spent, 99)),
            "p50_free_ms": 1e3 * float(np.median(np.array(spent)[~np.array(held)])),
            "p50_held_back_ms": 1e3 * float(np.median(np.array(spent)[held])) if any(held) else None,
            "held_back": sum(held),
            "parts_ms": {part: 1e3 * sum(clock) / len(spent) for part, clock in clocks.items()},
        }
    rival = result["mink"]["frames_per_second"]
    for name in list(mappings)[:-1]:
        result[name]["times_mink"] = result[name]["frames_per_second"] / rival
    return result


def _clocks(loop: TeleoperationLoop) -> dict[str, list[float]]:
    """Has the loop's parts note their processor time [s]."""
    found: dict[str, list[float]] = {}
    for part, owner, name in (
        ("doubt", loop, "_doubt"),
        ("mapping", loop, "_guarded"),
        ("motion", loop._motion, "follow"),
    ):
        found[part] = []
        setattr(owner, name, _Timed(getattr(owner, name), found[part]))
    return found


class _Timed:
    """Stands in for what it wraps."""

    def __init__(self, wrapped: Any, noted: list[float]) -> None:
        self._wrapped, self._noted = wrapped, noted

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        before = time.thread_time()
        result = self._wrapped(*arguments, **named)
        self._noted.append(time.thread_time() - before)
        return result

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wrapped, name)


def violations(args: argparse.Namespace) -> dict[str, Any]:
    """Joint-limit and speed-limit violations of the commands on every recording and on random walks."""
    result: dict[str, Any] = {}
    for robot_name in ("pepper", "nao"):
        robot = catalog.get(robot_name)
        assert isinstance(robot, Robot)
        for label, clips in _recordings(args.data).items():
            mapping = unfitted(clips[0].body, robot)
            total = np.zeros(5, dtype=np.int64)
            for clip in clips:
                times = (
                    np.arange(len(clip)) / clip.fps if clip.timestamps is None else clip.timestamps - clip.timestamps[0]
                )
                total += _count(mapping, robot, times, clip.frames)
            result[f"{label} > {robot_name}"] = _named(total)
        fitted = choose_mapping("adult", robot_name, motions="embedded")[0]
        walk = _random_walk(fitted.source, 20_000)
        result[f"random walk, {fitted.method} > {robot_name}"] = _named(
            _count(fitted, robot, np.arange(len(walk)) / 30.0, walk)
        )
    return result


def _recordings(data: Path | None) -> dict[str, list[MotionClip]]:
    found: dict[str, list[MotionClip]] = {}
    sources = ["embedded"] if data is None else [f"paper:{data / 'paper'}", *map(str, sorted(data.glob("[kb]*/*.*")))]
    for source in sources:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            motions = load_motions(source)
        for name, body in motions.bodies.items():
            if isinstance(body, HumanSkeleton):
                found[f"{motions.name} {name}"] = list(motions.clips(name))
    return found


def _random_walk(body: Any, count: int) -> FloatArray:
    """Limbs that turn at random, now and then at once; every frame is a possible body."""
    rng = np.random.default_rng(0)
    points = np.repeat(body.arm_points(body.standing()), count, axis=0)
    limbs = np.cumsum(rng.normal(scale=0.25, size=(count, len(body.sides), 2, 3)), axis=0)
    limbs[rng.random(count) < 0.02] = rng.normal(size=3)
    limbs *= body.arm_lengths[..., None] / np.linalg.norm(limbs, axis=-1, keepdims=True)
    points[:, :, 1] = points[:, :, 0] + limbs[:, :, 0]
    points[:, :, 2] = points[:, :, 1] + limbs[:, :, 1]
    frames: FloatArray = body.frames_from_points(points)
    return frames


def _count(mapping: Mapping, robot: Robot, times: FloatArray, frames: FloatArray) -> np.ndarray[Any, Any]:
    """Commands, limit violations, speed violations, self-collisions, frames used."""
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0, soft_start=0.0))
    decisions = [loop.step(Tick(float(t), frame, float(t))) for t, frame in zip(times, frames, strict=True)]
    path = np.array([decision.command for decision in decisions])
    rate = np.abs(np.diff(path, axis=0)) / np.maximum(np.diff(times)[:, None], 1e-12)
    check = loop._collision
    touching = sum(check.touches(q) for q in path[:: max(1, len(path) // 500)]) if check is not None else 0
    return np.array(
        [
            len(path),
            robot.violations(path, 0.0).sum(),
            (rate > robot.speed * (1 + 1e-12)).sum(),
            touching,
            sum(decision.frame_used for decision in decisions),
        ]
    )


def _named(total: np.ndarray[Any, Any]) -> dict[str, int]:
    names = ("commands", "limit_violations", "speed_violations", "self_collisions", "frames_used")
    return dict(zip(names, total.tolist(), strict=True))


def network(args: argparse.Namespace) -> dict[str, Any]:
    """An hour of a network that loses 30 %, doubles, reorders and sends garbage, in simulated time."""
    mapping = chosen(args)
    loop, decoder, ordering, inbox = _receiver(mapping)
    now, sizes, count, refused, before = 0.0, [], 0, 0, loop.command
    limit = speed = 0
    robot = loop.robot
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.jsonl.gz"
        with Journal(path, loop) as journal:
            began = time.perf_counter()
            for number, packets in enumerate(_bad_stream(operator_frames(3000), int(args.hours * 108_000))):
                last, now = now, number / 30.0
                for data in packets:
                    try:
                        packet = decoder(data)
                        reason = ordering.admit(packet, now)
                        if reason:
                            raise PacketError(reason, reason)
                        inbox.put(packet, now)
                    except PacketError as error:
                        inbox.drop(error.reason)
                        refused += 1
                received = inbox.take(0.0)
                packet_in = received.packet
                tick = Tick(
                    now,
                    None if packet_in is None else packet_in.frame,
                    None if packet_in is None else packet_in.sent,
                    controls=received.controls,
                )
                decision = loop.step(tick)
                journal.decided(tick, decision)
                count += packet_in is not None
                limit += int(robot.violations(decision.command, 0.0).sum())
                speed += int((np.abs(decision.command - before) > robot.speed * (now - last) + 1e-15).sum())
                before = decision.command
                if number % 9000 == 0:
                    sizes.append(_resident())
            took = time.perf_counter() - began
        journal_mb = path.stat().st_size / 2**20
        replay = replay_journal(path, mapping)
    return {
        "hours": args.hours,
        "frames_accepted": count,
        "packets_refused": refused,
        "refused_by_reason": dict(inbox.dropped),
        "limit_violations": limit,
        "speed_violations": speed,
        "resident_mb_every_5_minutes": sizes,
        "journal_mb": journal_mb,
        "replayed_decisions": replay.ticks,
        "replayed_bit_for_bit": replay.exact,
        "seconds": took,
    }


def fuzz(args: argparse.Namespace) -> dict[str, Any]:
    """Broken packets: bytes flipped, cut, doubled, exchanged for pieces of JSON; each is read or refused."""
    body = catalog.get("adult")
    decoder, rng = PacketDecoder(body), np.random.default_rng(0)
    good = [
        encode_frame(7, 1.5, np.arange(18) / 9.0, confidence=0.5),
        b'{"v":1,"seq":1,"t":0.5,"control":"pause"}',
        b'{"v":1,"seq":2,"t":1,"joints":{"LShoulder":[0,0,0],"LElbow":[0,0,1],"Head":[1,2,3]}}',
    ]
    pieces = [
        b"NaN", b"-Infinity", b"null", b"true", b"[]", b"{}", b'""', b"1e999", b"-0", b"1e-400", b"9" * 400, b"\\ud800",
        b"[" * 50, b'{"":' * 20, b",", b":", b'"', b"\xff", b"\x00", b'"frame":', b'"control":"stop"', b'"v":1',
    ]  # fmt: skip
    outcome: dict[str, int] = {}
    for _ in range(args.inputs):
        data = bytearray(good[int(rng.integers(len(good)))])
        for _ in range(int(rng.integers(1, 5))):
            at, how = int(rng.integers(len(data) + 1)), rng.random()
            if how < 0.4:
                data[at : at + 1] = bytes([int(rng.integers(256))])
            elif how < 0.7:
                data[at : at + int(rng.integers(12))] = pieces[int(rng.integers(len(pieces)))]
            elif how < 0.85:
                del data[at : at + int(rng.integers(1, 60))]
            else:
                data[at:at] = data[: int(rng.integers(60))]
        try:
            packet = decoder(bytes(data))
            sound = packet.frame is None or bool(np.isfinite(packet.frame).all() and packet.frame.shape == (18,))
            reason = "read" if sound and 0.0 <= packet.tracking <= 1.0 else "UNSOUND"
        except PacketError as error:
            reason = error.reason
        outcome[reason] = outcome.get(reason, 0) + 1
    return {"inputs": args.inputs, "outcome": dict(sorted(outcome.items(), key=lambda item: -item[1]))}


def _receiver(mapping: Mapping) -> tuple[TeleoperationLoop, PacketDecoder, Ordering, Inbox]:
    loop = TeleoperationLoop(mapping, LoopSettings(calibration=0.0))
    return loop, PacketDecoder(mapping.source), Ordering(), Inbox()


def _bad_stream(frames: FloatArray, count: int) -> Iterator[list[bytes]]:
    """What arrives in each thirtieth of a second."""
    rng, late = np.random.default_rng(0), b""
    junk = [b"", b"{", b"\xff" * 40, b"x" * 20_000, b'{"v":1,"seq":5,"t":1,"frame":[NaN]}', b"[" * 9000, b"{}" * 50]
    for index in range(count):
        packets = []
        good = encode_frame(index, index / 30.0, frames[index % len(frames)])
        chance = rng.random(5)
        if chance[0] > 0.3:
            packets.append(good)
        if chance[1] < 0.1:
            packets.append(good)
        if chance[2] < 0.1 and late:
            packets.insert(0, late)
        if chance[3] < 0.1:
            packets.append(junk[int(rng.integers(len(junk)))])
        if chance[4] < 0.1:
            broken = bytearray(good)
            broken[int(rng.integers(len(broken)))] = int(rng.integers(256))
            packets.append(bytes(broken))
        late = good
        # An outage of two to five seconds a minute, so that holding, easing and waking up are part of the hour.
        yield [] if index % 1800 > 1800 - rng.integers(60, 150) else packets


def _resident() -> float:
    """Resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return round(pages * os.sysconf("SC_PAGE_SIZE") / 2**20, 1)


if __name__ == "__main__":
    main()
