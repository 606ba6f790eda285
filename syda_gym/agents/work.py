"""Work: what the commands ``train``, ``evaluate``, ``play`` and ``export`` call, one function each."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent, BaseAlone
from syda_gym.agents.bundle import load_agent, read_card, save_agent
from syda_gym.agents.classical.rivals import RIVALS
from syda_gym.agents.classical.tuned import cell_of, tuned_rival
from syda_gym.agents.classical.tuning import Tuned, tune
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.residual.checkpoint import load_checkpoint
from syda_gym.agents.residual.config import STACK, ResidualConfig
from syda_gym.agents.rollout import EpisodeResult, evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import score_streams
from syda_gym.agents.training import Comparison, beside, compare_on_streams, train_stack, without_lead
from syda_gym.embodiments.catalog import resolve
from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.errors import AgentError, nearest_name
from syda_gym.files import asset
from syda_gym.locks import locked_folder
from syda_gym.mappings.mapping import Mapping as MotionMapping
from syda_gym.mappings.storage import save_mapping

__all__ = [
    "PlayedEpisode",
    "TrainingReport",
    "TunedRival",
    "compare_agents",
    "default_config",
    "export_bundle",
    "film",
    "find_agent",
    "play_episode",
    "shipped_agents",
    "train_agent",
    "tune_rivals",
]

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class TrainingReport:
    """What ``train_agent`` made.

    Attributes:
        agent: the trained stack.
        bundle: where it was stored.
        history: steps or round, figures of the agent, figures of what it stands on.
        best: index into ``history``.
        comparison: base, lead, tuned Kalman filter, what it stands on, and the agent, on the validation episodes.
    """

    agent: Agent
    bundle: Path
    history: tuple[tuple[int, Figures, Figures], ...]
    best: int
    comparison: Comparison


@dataclass(frozen=True)
class TunedRival:
    """A rival as ``tune_rivals`` found it.

    Attributes:
        tuned: settings and figures on the training episodes.
        before: figures on the validation episodes with the shipped settings of the cell.
        after: with the new ones.
    """

    tuned: Tuned
    before: Figures
    after: Figures


def train_agent(
    options: TeleopOptions | Mapping[str, Any],
    out: str | os.PathLike[str],
    *,
    config: ResidualConfig | PredictorConfig | None = None,
    base: str | os.PathLike[str] = "",
    seed: int = 0,
    resume: bool = False,
    progress: Progress | None = None,
) -> TrainingReport:
    """Trains a residual policy or a predictor and stores it as ``out/agent``.

    Args:
        options: of the environment; disturbances included.
        out: folder of bundle, checkpoints and logs.
        config: a ``ResidualConfig`` trains a residual policy by reinforcement learning, a ``PredictorConfig`` a
            predictor by regression.
        base: what it stands on: ``"stack"``, a rival's name (with the settings of the cell), or the path of a bundle.
            By default what the configuration names: for the shipped ones a predictor, which is trained first, on the
            tuned Kalman filter. A predictor stands on that filter; a lead is left off, since it brings its own.
        seed: of everything.
        resume: go on from the checkpoint in ``out`` (residual policies).
        progress: called with the share that is done.

    Raises:
        SydaError: bad options, nothing to resume, a bundle that does not fit, a folder that another process writes.
    """
    settings = config or default_config(options)
    if resume and isinstance(settings, ResidualConfig):
        load_checkpoint(Path(out) / "checkpoint.safetensors")  # before minutes of fitting and recording are spent
    with locked_folder(out, "agent") as folder:
        return _train(options, folder, settings, base, seed, resume, progress)


def _train(
    options: TeleopOptions | Mapping[str, Any],
    folder: Path,
    settings: ResidualConfig | PredictorConfig,
    base: str | os.PathLike[str],
    seed: int,
    resume: bool,
    progress: Progress | None,
) -> TrainingReport:
    ground = Ground(options)
    if isinstance(settings, PredictorConfig):
        below = find_agent(_named(base) or "kalman", ground.interface, ground.options.disturbances)
        report = _predict(ground, settings, below, seed, folder, progress)
    else:
        rival = None
        if _named(base):
            rival = find_agent(base, ground.interface, ground.options.disturbances)
        elif os.fspath(base) == STACK:
            settings = ResidualConfig.of({**settings.as_dict(), "base": STACK, "base_settings": {}})
        found = train_stack(ground, settings, base=rival, seed=seed, folder=folder, resume=resume, progress=progress)
        history = tuple((leg.steps, leg.policy, leg.base) for leg in found.trained.history)
        report = TrainingReport(
            found.trained.agent, folder / "agent.json", history, found.trained.best, found.comparison
        )
    save_agent(
        report.agent,
        folder / "agent",
        mapping=_mapping_card(ground),
        training={"seed": seed, "config": _plain(settings), "options": _described(ground.options)},
        figures={
            "validation": report.history[report.best][1].as_dict(),
            "base": report.history[report.best][2].as_dict(),
            "beside": {name: figures.as_dict() for name, figures in report.comparison.figures.items()},
        },
    )
    save_mapping(ground.repertoire.pilot.mapping(ground.repertoire.routes[0].bodies), folder / "mapping")
    return report


def tune_rivals(
    options: TeleopOptions | Mapping[str, Any],
    names: Sequence[str],
    *,
    episodes: int = 32,
    budget: int = 24,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> dict[str, TunedRival]:
    """Tunes rivals on an environment's motions by the objective ``J``, in the servo model.

    Every fifth action is kept for validation.

    Args:
        options: of the environment; keep test motions out of it.
        names: of ``RIVALS``.
        episodes: how many are recorded, spread over the clips.
        budget: settings to try per rival.
        seed: of disturbances and search.
        out: folder to store the tuned agents in, each as a bundle under its name; nothing is stored if left out.
        progress: called with the share that is done.
    """
    ground = Ground(options)
    streams = ground.record_part("train", episodes, seed=seed)
    validation = ground.record_part("validation", max(episodes // 2, 1), seed=seed + 1)
    found: dict[str, TunedRival] = {}
    for place, name in enumerate(names):
        tuned = tune(
            name, ground.interface, lambda agent: score_streams(agent, streams, ground.rates), budget=budget, seed=seed
        )
        before = tuned_rival(name, ground.interface, ground.options.disturbances)
        agent = tuned.build(ground.interface)
        scores = [score_streams(one, validation, ground.rates) for one in (before, agent)]
        found[name] = TunedRival(tuned, scores[0], scores[1])
        if out is not None:
            save_agent(
                agent,
                Path(out) / name,
                mapping=_mapping_card(ground),
                training={"tuned": name, "seed": seed, "budget": budget, "options": _described(ground.options)},
                figures={"training": tuned.figures.as_dict(), "validation": scores[1].as_dict()},
            )
        if progress is not None:
            progress((place + 1) / len(names))
    return found


def default_config(options: TeleopOptions | Mapping[str, Any]) -> ResidualConfig:
    """The shipped configuration for such disturbances: ``undisturbed`` where there are none, else ``teleop``."""
    given = options if isinstance(options, TeleopOptions) else TeleopOptions(**options)
    return ResidualConfig.preset("undisturbed" if cell_of(given.disturbances) == "lag" else "teleop")


def find_agent(name: str | os.PathLike[str], where: Any, disturbances: Any = None) -> Agent:
    """An agent by name or path.

    Args:
        name: of a rival, of a shipped bundle, or the path of a bundle.
        where: environment or interface that it shall act in.
        disturbances: a rival has the settings that were tuned for their cell; those of the environment by default.

    Raises:
        AgentError: no such agent; the message lists what there is.
    """
    interface = where if isinstance(where, Interface) else Interface.of(where)
    if disturbances is None and not isinstance(where, Interface):
        disturbances = getattr(where, "unwrapped", where).options.disturbances
    text = os.fspath(name)
    if text == "base":
        return BaseAlone(interface)
    if text in RIVALS:
        return tuned_rival(text, interface, disturbances)
    if text in shipped_agents():
        return load_agent(asset("agents", text), interface)
    if Path(text).with_suffix(".json").is_file() or Path(text).suffix in (".json", ".safetensors"):
        return load_agent(text, interface)
    known = (*RIVALS, *shipped_agents())
    raise AgentError(f"no agent {text!r}: neither a bundle's path nor a name; {nearest_name(text, known)}")


def shipped_agents() -> tuple[str, ...]:
    """Names of the bundles that come with the package."""
    return tuple(sorted(path.stem for path in asset("agents").glob("*.json")))


def compare_agents(
    options: TeleopOptions | Mapping[str, Any],
    agents: Sequence[str | os.PathLike[str]],
    *,
    clips: Sequence[int | str] | None = None,
    draws: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, list[EpisodeResult]]:
    """Plays agents, by name or path, on the same episodes; ``base`` is always among them.

    Args:
        options: of the environment.
        agents: see ``find_agent``.
        clips: which to play; all by default.
        draws: episodes per clip.
        seed: of disturbances.
        progress: called with the share that is done.
    """
    given = options if isinstance(options, TeleopOptions) else TeleopOptions(**options)
    env = SydaTeleopEnv(options=given)
    interface = Interface.of(env)
    env.close()
    names = list(dict.fromkeys(["base", *(os.fspath(agent) for agent in agents)]))
    return evaluate(
        given,
        {name: find_agent(name, interface, given.disturbances) for name in names},
        clips=clips,
        draws=draws,
        seed=seed,
        progress=progress,
    )


@dataclass(frozen=True, eq=False)
class PlayedEpisode:
    """One episode as it went.

    Attributes:
        robot: who followed.
        operator: who led.
        q: the robot's joint angles ``(N, n)`` [rad].
        reference: where it should have been ``(N, n)`` [rad].
        frames: the operator's ``(N, F)``.
        fps: control steps per second.
        figures: how good it was.
    """

    robot: Robot
    operator: Embodiment
    q: FloatArray
    reference: FloatArray
    frames: FloatArray
    fps: float
    figures: Figures


def play_episode(
    options: TeleopOptions | Mapping[str, Any], agent: str | os.PathLike[str], *, clip: int | str = 0, seed: int = 0
) -> PlayedEpisode:
    """Plays one episode.

    Args:
        options: of the environment.
        agent: see ``find_agent``.
        clip: index or name.
        seed: of disturbances.
    """
    from syda_gym.agents.figures import episode_figures

    given = options if isinstance(options, TeleopOptions) else TeleopOptions(**options)
    env = SydaTeleopEnv(options=TeleopOptions.of(given, {"action_mode": "position"}))
    acting = find_agent(agent, env)
    operator = env.layout["operator"]
    try:
        observation, _ = env.reset(seed=seed, options={"motion": clip})
        acting.reset(1, seed)
        rows: list[tuple[Any, ...]] = []
        done = False
        while not done:
            seen = np.asarray(observation[operator], dtype=np.float64)
            action = env.action_from_command(acting.act(observation[None])[0])
            observation, _, terminated, truncated, info = env.step(np.asarray(action, dtype=np.float32))
            rows.append((info["q"], info["reference"], info["contacts"], seen))
            done = terminated or truncated
    finally:
        env.close()
    q, reference, contacts, frames = (np.array(column) for column in zip(*rows, strict=True))
    figures = episode_figures(env.robot, q, reference, contacts)
    return PlayedEpisode(env.robot, resolve(given.operator), q, reference, frames, float(env.control_hz), figures)


def film(
    options: TeleopOptions | Mapping[str, Any],
    agent: str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    clip: int | str = 0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Figures:
    """Plays one episode and writes it as a video: operator, robot, and the reference as a ghost.

    Args:
        options: of the environment.
        agent: see ``find_agent``.
        path: of the ``.mp4``.
        clip: index or name.
        seed: of disturbances.
        progress: called with the share that is done.

    Returns:
        Figures of the episode.
    """
    from syda_gym.simulation.pictures.camera import Camera
    from syda_gym.simulation.pictures.video import write_video

    played = play_episode(options, agent, clip=clip, seed=seed)
    q, reference, frames = played.q, played.reference, played.frames
    with Camera(played.robot, played.operator) as camera:

        def pictures() -> Any:
            for index in range(len(q)):
                if progress is not None:
                    progress((index + 1) / len(q))
                yield camera.picture(q[index], reference=reference[index], operator=frames[index])

        write_video(path, pictures(), fps=played.fps)
    return played.figures


def export_bundle(
    bundle: str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    mapping: str | os.PathLike[str] | None = None,
    agent_only: bool = False,
) -> float:
    """Writes mapping and agent as one ONNX graph with a card beside it, and compares it with the numpy runner.

    Args:
        bundle: path of the bundle, or name of a shipped one.
        path: of the ``.onnx`` file; the card is written as ``.onnx.json`` beside it.
        mapping: path of a stored mapping; by default the one stored beside the bundle (``mapping.json``), or the
            shipped ones along the bundle's route.
        agent_only: leave the mapping out; the graph then reads the environment's observation.

    Returns:
        Largest difference of commands [rad].

    Raises:
        MissingExtraError: onnx or onnxruntime is not installed.
        AgentError: a part without a graph, no mapping for the bundle's route, or the graph differs from the original by
            more than a microradian.
    """
    from syda_gym.agents.deployment.export import agent_parity, card_path, export_onnx, runner_parity
    from syda_gym.agents.deployment.numpy_runner import Runner, bundle_path, find_mapping, stored_interface
    from syda_gym.agents.deployment.onnx_runners import OnnxAgent, OnnxRunner

    source = bundle_path(bundle)
    interface = stored_interface(read_card(source))
    agent = load_agent(source, interface)
    if agent_only:
        export_onnx(agent, path)
        difference = agent_parity(agent, OnnxAgent(path), _plausible(interface))
    else:
        found = find_mapping(source, mapping)
        export_onnx(agent, path, found)
        difference = runner_parity(Runner(agent, found), OnnxRunner(path), _plausible_frames(found))
    if not difference < 1e-6:
        for written in (Path(path), card_path(path)):
            written.unlink(missing_ok=True)
        raise AgentError(f"the graph differs from the original by {difference:.2g} rad; this is a defect, report it")
    return difference


def mean_table(results: Mapping[str, Sequence[EpisodeResult]]) -> dict[str, Figures]:
    """Mean figures of every agent."""
    return {name: mean_of(found) for name, found in results.items()}


def _predict(
    ground: Ground, config: PredictorConfig, base: Agent, seed: int, folder: Path, progress: Progress | None
) -> TrainingReport:
    train = ground.record_part("train", 256, seed=2 * seed)
    validation = ground.record_part("validation", 48, seed=2 * seed + 1)
    filters = without_lead(base)
    trained = train_predictor(filters, train, validation, ground.rates, config, seed=seed, progress=progress)
    below = score_streams(filters, validation, ground.rates)
    history = tuple((index, figures, below) for index, figures in enumerate(trained.history))
    agents = beside(ground, base) | {"predictor": trained.agent}
    comparison = compare_on_streams(agents, validation, ground)
    return TrainingReport(trained.agent, folder / "agent.json", history, trained.best, comparison)


def _named(base: str | os.PathLike[str]) -> str:
    """The base where one is named, neither left to the configuration nor the stack."""
    return "" if os.fspath(base) in ("", STACK) else os.fspath(base)


def _plausible(interface: Interface, steps: int = 50) -> Any:
    """Observations along a random smooth motion, ``(T, 2, size)``."""
    rng = np.random.default_rng(0)
    robot = interface.robot
    observations = np.zeros((steps, 2, interface.size))
    walk = np.cumsum(rng.normal(0.0, 0.02, (steps, 2, interface.n)), axis=0)
    q = np.stack([robot.clamp(robot.rest + step) for step in walk])
    observations[..., interface.layout["q"]] = q
    observations[..., interface.layout["base_error"]] = rng.normal(0.0, 0.03, q.shape)
    observations[..., interface.layout["packet_age"]] = rng.integers(0, 4, (steps, 2, 1)) * interface.dt
    return observations


def _plausible_frames(mapping: MotionMapping) -> Any:
    """Frames of the operator along a random smooth motion about its standing or rest pose, ``(T, F)``."""
    body = mapping.source
    middle = body.standing() if isinstance(body, HumanSkeleton) else body.rest  # type: ignore[attr-defined]
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.normal(0.0, 0.02, (50, body.n_features)), axis=0)
    return middle + walk


def _mapping_card(ground: Ground) -> dict[str, Any]:
    bodies = ground.repertoire.routes[0].bodies
    card = ground.repertoire.pilot.mapping(bodies).card
    return {"route": list(bodies), "method": card.method, "preset": card.preset}


def _plain(config: ResidualConfig | PredictorConfig) -> dict[str, Any]:
    return config.as_dict() if isinstance(config, ResidualConfig) else dict(vars(config))


def _described(options: TeleopOptions) -> dict[str, str]:
    return {name: str(value) for name, value in vars(options).items() if value is not None}
