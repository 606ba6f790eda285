"""Everything that reads from outside, with valid samples and the ways to damage them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_build import BUILDERS, Builder
from fuzz_damage import Damage, in_archive, in_bytes, in_json, in_json_lines, in_weights, in_yaml, mixed

import syda_gym
from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.predictor import Predictor, input_count
from syda_gym.agents.learned.tcn import TcnShape
from syda_gym.agents.residual.checkpoint import load_checkpoint
from syda_gym.embodiments import catalog
from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.robot import Robot
from syda_gym.evaluation.benchmark.config import BenchmarkConfig
from syda_gym.files import asset, fingerprint, read_json, write_json
from syda_gym.motions.dataset import write_dataset
from syda_gym.motions.loading import FORMATS
from syda_gym.motions.readers.said import told
from syda_gym.teleoperation import TeleoperationLoop
from syda_gym.teleoperation.incoming.packets import PacketDecoder, encode_frame, encode_request
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.tick import Tick

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.motions import paper_workbooks, recordings  # sample recordings are written by the tests

__all__ = ["Target", "all_targets"]


@dataclass(frozen=True)
class Target:
    """Something that reads.

    Attributes:
        name: what it is called in the results.
        samples: what it likes.
        read: how it is called.
        damage: how its samples are damaged.
        share: how many inputs it gets, relative to the others; quick readers more.
        build: what is built for it besides damage.
    """

    name: str
    samples: list[bytes]
    read: Callable[[bytes], Any]
    damage: Damage = in_bytes
    share: float = 1.0
    build: tuple[Builder, ...] = ()


def all_targets(folder: Path) -> list[Target]:
    """Every target, with its samples written into ``folder``, and what is built for it besides damage."""
    targets = [
        *motion_targets(folder),
        *mapping_targets(folder),
        *agent_targets(folder),
        *robot_targets(folder),
        *live_targets(folder),
        benchmark_target(folder),
    ]
    return [replace(target, build=BUILDERS.get(target.name, ())) for target in targets]


def motion_targets(folder: Path) -> list[Target]:
    """Every format of ``load_motions``."""

    def file_target(name: str, files: list[Path], damage: Damage = in_bytes) -> Target:
        place = folder / f"damaged-{name}{files[0].suffix}"

        def read(data: bytes) -> Any:
            place.write_bytes(data)
            return FORMATS[name].read(place)

        return Target(f"motions-{name}", [file.read_bytes() for file in files], read, damage)

    def text(name: str, content: str) -> Path:
        (folder / name).write_text(content)
        return folder / name

    few = few_motions()
    syda_gym.save_motions(few, folder / "few.npz")
    kinect = recordings.write_rows(folder / "kinect.csv", recordings.kinect_rows(12))
    openni = recordings.write_rows(folder / "openni.txt", recordings.openni_rows(12), separator=" ", end="")
    pose = {"fps": 25, "frames": recordings.mediapipe_json(4)}
    return [
        file_target("npz", [folder / "few.npz"], mixed(in_archive)),
        file_target("kinect", [kinect]),
        file_target("openni", [openni, text("cornell.txt", "\n".join(recordings.cornell_lines(6)))]),
        file_target("bvh", [text("walk.bvh", recordings.bvh_text())]),
        file_target("mvnx", [text("walk.mvnx", mvnx_of_somebody())]),
        file_target("mediapipe", [text("pose.json", recordings.json_text(pose))], mixed(in_json)),
        file_target("keypoints", [points_file(folder)], mixed(in_archive)),
        file_target("table", [*case_files("*.csv"), *case_files("*.txt"), *case_files("*.skeleton")]),
        file_target("azure", case_files("azure*.json"), mixed(in_json)),
        layout_target(folder),
        *capture_targets(folder),
        paper_target(folder),
        *pairs_targets(folder, few),
    ]


def mvnx_of_somebody() -> str:
    """Six frames of Xsens MVN; segments that the synthetic person lacks lie at its neck."""
    _, joints = recordings.moving_human(count=6)
    parts = {"UpperArm": "Shoulder", "ForeArm": "Elbow", "Hand": "Hand", "UpperLeg": "Hip", "LowerLeg": "Knee"}
    names = [
        next((f"{name[0]}{joint}" for part, joint in parts.items() if name in (f"Left{part}", f"Right{part}")), "Neck")
        for name in recordings.MVNX_SEGMENTS.split()
    ]
    return recordings.mvnx_text(np.stack([joints[name] for name in names], axis=1))


def case_files(pattern: str) -> list[Path]:
    """The small case files of the tests."""
    return sorted((Path(__file__).resolve().parents[1] / "tests" / "motions" / "readers" / "cases").glob(pattern))


def points_file(folder: Path) -> Path:
    """Landmarks as an archive of arrays."""
    np.savez(folder / "points.npz", pose=recordings.mediapipe_table(6), fps=np.array(25.0))
    return folder / "points.npz"


def layout_target(folder: Path) -> Target:
    """The YAML in which somebody describes a format of their own."""
    place = folder / "layout.yaml"
    text = b"order: [LShoulder, LElbow, LHand, RShoulder, RElbow, RHand]\nunit: mm\nup: z\nfps: 50\njoints: {Head: 3}\n"
    place.write_bytes(text)
    return Target("motions-layout", [text], replacing(place, lambda: told(layout=place)), mixed(in_yaml), share=0.3)


def capture_targets(folder: Path) -> list[Target]:
    """C3D, which is opened in a process of its own and so gets few inputs; none without the library."""
    try:
        import ezc3d
    except ImportError:
        return []
    place = folder / "small.c3d"
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    names = ["LSHO", "LELB", "LWRA", "LWRB", "RSHO", "RELB", "RWRA", "RWRB"]
    point["RATE"]["value"], point["LABELS"]["value"], point["UNITS"]["value"] = [100.0], names, ["mm"]
    file["data"]["points"] = np.random.default_rng(0).normal(size=(4, len(names), 12)) * 300.0
    file.write(str(place))
    damaged = folder / "damaged.c3d"

    def read(data: bytes) -> Any:
        damaged.write_bytes(data)
        return FORMATS["c3d"].read(damaged)

    return [Target("motions-c3d", [place.read_bytes()], read, share=0.01)]


def few_motions() -> syda_gym.Motions:
    """Two short synthetic takes."""
    tiny = syda_gym.load_motions("embedded", fps=2)
    return syda_gym.Motions(tiny.name, tiny.takes[:2], tiny.bodies, tiny.families, synthetic=True)


def paper_target(folder: Path) -> Target:
    """A data set of small workbooks, one of which is damaged."""
    root = paper_workbooks.write_dataset(folder / "paper")
    victim = root / "Pepper2Human" / "human_P01A01T01.xlsx"
    read = replacing(victim, lambda: FORMATS["paper"].read(root))
    return Target("motions-paper", [victim.read_bytes()], read, mixed(in_archive), share=0.6)


def pairs_targets(folder: Path, motions: syda_gym.Motions) -> list[Target]:
    """The index and one table of a data set folder."""
    root = write_dataset(motions, folder / "pairs")
    index = root / "dataset.json"
    table = next(iter(sorted(root.rglob("*.csv"))))

    def read() -> Any:
        return FORMATS["pairs"].read(root)

    return [
        Target("motions-pairs-index", [index.read_bytes()], replacing(index, read), mixed(in_json)),
        Target("motions-pairs-table", [table.read_bytes()], replacing(table, read)),
    ]


def mapping_targets(folder: Path) -> list[Target]:
    """The two files of a stored mapping, damaged one at a time; half of the weights come with a card that fits them."""
    pair = syda_gym.load_motions("embedded", fps=2).pair("adult", "pepper")
    pair = pair.only_actions(pair.action_names[:4])
    for name, method in (("ridge", "ridge"), ("near", "nearest"), ("syda", "syda")):
        syda_gym.save_mapping(syda_gym.fit(pair, method=method, seed=0), folder / name)
    weights, card = folder / "ridge.safetensors", folder / "ridge.json"

    def read() -> Any:
        return syda_gym.load_mapping(folder / "ridge")

    def read_marked(data: bytes) -> Any:
        content = read_json(folder / "near.json")
        write_json(folder / "marked.json", {**content, "weights": fingerprint(data)})
        (folder / "marked.safetensors").write_bytes(data)
        return syda_gym.load_mapping(folder / "marked")

    near = (folder / "near.safetensors").read_bytes()
    return [
        Target("mapping-weights", [weights.read_bytes(), near], replacing(weights, read), share=0.5),
        Target("mapping-weights-marked", [near], read_marked, mixed(in_weights), share=0.7),
        Target("mapping-card", [card.read_bytes()], replacing(card, read), mixed(in_json), share=0.8),
        Target(
            "mapping-card-syda",
            [(folder / "syda.json").read_bytes()],
            replacing(folder / "syda.json", lambda: syda_gym.load_mapping(folder / "syda")),
            mixed(in_json),
            share=0.7,
        ),
    ]


def agent_targets(folder: Path) -> list[Target]:
    """The two files of an agent's bundle, and a training's checkpoint."""
    robot = catalog.get("pepper")
    n = robot.n_features
    parts = {"base_error": n, "q": n, "qd": n, "packet_age": 1}
    ends = np.cumsum(list(parts.values())).tolist()
    layout = {name: slice(end - size, end) for (name, size), end in zip(parts.items(), ends, strict=True)}
    interface = Interface(robot, layout, ends[-1], 1 / 30, 0.5)
    rng = np.random.default_rng(0)
    shapes = TcnShape(input_count(interface), 4, n).shapes()
    stored = {name: rng.normal(0, 0.1, size).astype(np.float32) for name, size in shapes.items()}
    agent = Predictor(interface, make_rival("kalman", interface), weights=stored, channels=4)
    card = save_agent(agent, folder / "agent")
    weights = card.with_suffix(".safetensors")

    policy = save_agent(
        ResidualPolicy.untrained(interface, BaseAlone(interface), hidden=(4,)), folder / "policy"
    ).with_suffix(".safetensors")

    def read(name: str = "agent") -> Any:
        loaded = load_agent(folder / name, interface)
        loaded.reset(1)
        return loaded.act(np.zeros((1, interface.size)))

    def read_checkpoint(data: bytes) -> Any:
        (folder / "training.safetensors").write_bytes(data)
        return load_checkpoint(folder / "training.safetensors")

    return [
        Target("agent-card", [card.read_bytes()], replacing(card, read), mixed(in_json)),
        Target("agent-weights", [weights.read_bytes()], replacing(weights, read), mixed(in_weights)),
        Target(
            "agent-policy-weights",
            [policy.read_bytes()],
            replacing(policy, lambda: read("policy")),
            mixed(in_weights),
            share=0.5,
        ),
        Target("agent-checkpoint", [checkpoint_bytes()], read_checkpoint, mixed(in_weights)),
        *onnx_targets(folder),
    ]


def onnx_targets(folder: Path) -> list[Target]:
    """An exported graph; none without the libraries."""
    try:
        import onnx  # noqa: F401
        import onnxruntime  # noqa: F401
    except ImportError:
        return []
    from syda_gym.agents.deployment.onnx_runners import OnnxAgent

    place = folder / "agent.onnx"

    def read(data: bytes) -> Any:
        place.write_bytes(data)
        return OnnxAgent(place)

    sample = BUILDERS["agent-onnx"][0]([], np.random.default_rng(0))
    return [Target("agent-onnx", [sample], read, share=0.2)]


def checkpoint_bytes() -> bytes:
    """A small file of the kind that a training writes."""
    import json

    from safetensors.numpy import save

    about = {"format": 1, "state": {"seed": 0}, "groups": {}, "steps": 8, "updates": 1}
    return save({"policy/weight": np.zeros((2, 3), dtype=np.float32)}, metadata={"training": json.dumps(about)})


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

    descriptions = [asset("robots", f"{name}.yaml").read_bytes() for name in ("nao", "pepper")]
    return [
        Target("robot-yaml", descriptions, read_description, mixed(in_yaml), share=0.3),
        Target("robot-urdf", [asset("robots", "nao.urdf").read_bytes()], read_tree, share=0.3),
    ]


def live_targets(folder: Path) -> list[Target]:
    """Packets of the live sources, with and without a token, and the journal of a run."""
    body = catalog.get("adult")
    frame = np.linspace(-0.3, 0.3, body.n_features)
    samples = [
        encode_frame(1, 0.5, frame),
        encode_frame(2, 1.5, frame, token="secret", confidence=0.5),
        encode_request(3, 2.0, "pause"),
    ]
    mapping = syda_gym.load_mapping(folder / "ridge")
    loop = TeleoperationLoop(mapping)
    journal = folder / "run.jsonl"
    with Journal(journal, loop) as writing:
        for number in range(12):
            tick = Tick(
                100.0 + number / 30, frame if number % 3 else None, None, 1.0, ("pause",) if number == 8 else ()
            )
            writing.decided(tick, loop.step(tick))
    return [
        Target("network-open", samples, PacketDecoder(body), mixed(in_json), share=6.0),
        Target("network-token", samples, PacketDecoder(body, token="secret"), mixed(in_json), share=6.0),
        Target(
            "journal",
            [journal.read_bytes()],
            replacing(journal, lambda: replay_journal(journal, mapping)),
            mixed(in_json_lines),
            share=0.15,
        ),
    ]


def benchmark_target(folder: Path) -> Target:
    """A benchmark's configuration."""
    text = b"""
motions: embedded
routes: [adult>pepper, adult>kid>pepper]
methods: [syda, direct]
agents: [base, lead]
seeds: [0, 1]
folds: 2
fit: {syda: {epochs: 3}}
efficiency: {chain: adult>kid>pepper, new_body: adult, actions: [1, 2], draws: 2}
"""
    place = folder / "study.yaml"
    place.write_bytes(text)
    return Target(
        "benchmark-yaml", [text], replacing(place, lambda: BenchmarkConfig.read(place)), mixed(in_yaml), share=0.6
    )


def replacing(path: Path, read: Callable[[], Any]) -> Callable[[bytes], Any]:
    """A reader of bytes that puts them at ``path`` for as long as it reads."""
    good = path.read_bytes()

    def reader(data: bytes) -> Any:
        path.write_bytes(data)
        try:
            return read()
        finally:
            path.write_bytes(good)

    return reader
