"""The commands that deal with agents: ``train``, ``evaluate``, ``play`` and ``export``; registered by ``cli``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from syda_gym.agents.figures import Figures

__all__ = ["evaluate", "export", "play", "train"]

MotionsOption = Annotated[str, typer.Option("--motions", "-m", help="`embedded`, `paper:DIR`, ...", metavar="SPEC")]
OperatorOption = Annotated[str, typer.Option(help="Who leads.")]
RobotOption = Annotated[str, typer.Option(help="Who follows.")]
RouteOption = Annotated[str, typer.Option(help="`auto`, or bodies such as `adult,kid,pepper`.")]
MappingOption = Annotated[str, typer.Option(help="Method of the mapping, or a folder of stored ones.")]
DisturbancesOption = Annotated[
    str, typer.Option(help="`none`, `teleop:CELL:LEVEL` or a single one such as `link:test`.")
]
ReferenceOption = Annotated[str, typer.Option(help="`paired`: the robot's own motion; `mapped`: the clean mapping.")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0)]
HeldOutOption = Annotated[str, typer.Option(help="Actions, comma-separated: left out of fits and training, or played.")]


def train(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of bundle, checkpoint and logs.")] = Path("agent"),
    kind: Annotated[
        str, typer.Option(help="`residual` (reinforcement learning) or `predictor` (regression).")
    ] = "residual",
    preset: Annotated[str, typer.Option(help="Preset of the residual policy's hyper-parameters.")] = "undisturbed",
    algorithm: Annotated[str, typer.Option(help="`ppo`, `sac` or `tqc`; the preset's by default.")] = "",
    steps: Annotated[int, typer.Option(help="Environment steps, or iterations; the preset's by default.", min=0)] = 0,
    base: Annotated[str, typer.Option(help="What it stands on: a rival's name or a bundle.")] = "base",
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint in the folder.")] = False,
    motions: MotionsOption = "embedded",
    operator: OperatorOption = "adult",
    robot: RobotOption = "pepper",
    route: RouteOption = "auto",
    mapping: MappingOption = "syda",
    disturbances: DisturbancesOption = "none",
    reference: ReferenceOption = "paired",
    held_out: HeldOutOption = "",
    seed: SeedOption = 0,
) -> None:
    """Train a residual policy or a predictor, beside what it stands on."""
    from syda_gym.agents.config import ResidualConfig
    from syda_gym.agents.predictor_training import PredictorConfig
    from syda_gym.agents.work import train_agent
    from syda_gym.errors import OptionError, nearest_name

    if kind not in ("residual", "predictor"):
        raise OptionError(f"unknown kind {kind!r}; {nearest_name(kind, ('residual', 'predictor'))}")
    config: Any
    if kind == "predictor":
        config = PredictorConfig(iterations=steps) if steps else PredictorConfig()
    else:
        changes: dict[str, Any] = {"algorithm": algorithm} if algorithm else {}
        config = ResidualConfig.preset(preset, **changes, **({"steps": steps} if steps else {}))
    options = _options(motions, operator, robot, route, mapping, disturbances, reference, held_out, training=True)
    with _bar("Training") as tell:
        report = train_agent(options, out, config=config, base=base, seed=seed, resume=resume, progress=tell)
    rows = {}
    for place, (step, figures, below) in enumerate(report.history):
        mark = "  (kept)" if place == report.best else ""
        rows[f"after {step}{mark}"] = figures
        last = below
    _print_figures({"what it stands on": last, **rows}, "Validation episodes, servo model")
    _say(f"stored: [bold]{report.bundle}[/]  (logs and checkpoint beside it; tensorboard --logdir {out})")


def evaluate(
    agents: Annotated[list[str], typer.Argument(help="Bundles, shipped agents or rivals' names.")],
    physics: Annotated[str, typer.Option(help="`bullet` or `servo`.")] = "bullet",
    draws: Annotated[int, typer.Option(help="Episodes per clip.", min=1)] = 1,
    clips: Annotated[int, typer.Option(help="Number of clips, spread over all; 0 plays all.", min=0)] = 0,
    motions: MotionsOption = "embedded",
    operator: OperatorOption = "adult",
    robot: RobotOption = "pepper",
    route: RouteOption = "auto",
    mapping: MappingOption = "syda",
    disturbances: DisturbancesOption = "none",
    reference: ReferenceOption = "paired",
    held_out: HeldOutOption = "",
    physics_hz: Annotated[float, typer.Option(help="Physics steps per second.")] = 240.0,
    seed: SeedOption = 0,
) -> None:
    """Play agents beside the base alone, on the same episodes."""
    import numpy as np

    from syda_gym.agents.work import compare_agents, mean_table
    from syda_gym.envs.teleop import SydaTeleopEnv

    options = _options(motions, operator, robot, route, mapping, disturbances, reference, held_out)
    options |= {"physics": physics, "physics_hz": physics_hz}
    chosen: list[int | str] | None = None
    if clips:
        env = SydaTeleopEnv(**options)
        chosen = list(np.linspace(0, len(env.clip_names) - 1, clips).round().astype(int).tolist())
        env.close()
    with _bar("Playing") as tell:
        results = compare_agents(options, agents, clips=chosen, draws=draws, seed=seed, progress=tell)
    count = len(next(iter(results.values())))
    _print_figures(mean_table(results), f"Means over {count} episodes, {physics}, disturbances {disturbances}")


def play(
    agent: Annotated[str, typer.Argument(help="A bundle, a shipped agent or a rival's name.")] = "base",
    out: Annotated[Path, typer.Option("--out", "-o", help="Video to write.")] = Path("play.mp4"),
    clip: Annotated[str, typer.Option(help="Name or number of the clip.")] = "0",
    motions: MotionsOption = "embedded",
    operator: OperatorOption = "adult",
    robot: RobotOption = "pepper",
    route: RouteOption = "auto",
    mapping: MappingOption = "syda",
    disturbances: DisturbancesOption = "none",
    reference: ReferenceOption = "paired",
    physics_hz: Annotated[float, typer.Option(help="Physics steps per second.")] = 240.0,
    seed: SeedOption = 0,
) -> None:
    """Play one episode in Bullet and film it: operator, robot, and where it should be as a ghost."""
    from syda_gym.agents.work import film

    options = _options(motions, operator, robot, route, mapping, disturbances, reference, "")
    options["physics_hz"] = physics_hz
    with _bar("Filming") as tell:
        figures = film(options, agent, out, clip=int(clip) if clip.isdigit() else clip, seed=seed, progress=tell)
    _print_figures({agent: figures}, f"Clip {clip}")
    _say(f"video: [bold]{out}[/]")


def export(
    bundle: Annotated[str, typer.Argument(help="A bundle or a shipped agent.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="ONNX file to write; a card of it as JSON beside.")] = Path(
        "agent.onnx"
    ),
    mapping: Annotated[
        str, typer.Option(help="A stored mapping; by default the one beside the bundle, or the shipped one.")
    ] = "",
    agent_only: Annotated[bool, typer.Option("--agent-only", help="Leave the mapping out.")] = False,
) -> None:
    """Write mapping and agent as one ONNX graph and check that it commands the same."""
    from syda_gym.agents.work import export_bundle

    difference = export_bundle(bundle, out, mapping=mapping or None, agent_only=agent_only)
    _say(f"graph: [bold]{out}[/]  largest difference from the original {difference:.1e} rad")
    _say(f"card of its inputs and outputs: [bold]{out}.json[/]")


def _options(
    motions: str,
    operator: str,
    robot: str,
    route: str,
    mapping: str,
    disturbances: str,
    reference: str,
    held_out: str,
    *,
    training: bool = False,
) -> dict[str, Any]:
    """Environment options from what the user wrote; held-out actions are kept out of fits and of training."""
    options: dict[str, Any] = {
        "motions": motions,
        "operator": operator,
        "robot": robot,
        "route": route if route == "auto" else tuple(route.replace(">", ",").split(",")),
        "mapping": mapping,
        "disturbances": None if disturbances == "none" else disturbances,
        "reference": reference,
    }
    names = tuple(name for name in held_out.split(",") if name)
    if names:
        options["held_out"] = names
        options["actions"] = names
        if training:
            from syda_gym.motions.loading import load_motions

            known = {take.action for take in load_motions(motions).takes}
            options["actions"] = tuple(sorted(known - set(names)))
    return options


def _print_figures(rows: Mapping[str, Figures], title: str) -> None:
    from rich.table import Table

    table = Table(
        "agent", "landmark error [mm]", "joint error [mrad]", "jitter [mm/frame³]", "contacts", "J", title=title
    )
    for name, figures in rows.items():
        table.add_row(
            name,
            f"{figures.landmark_mm:.2f}",
            f"{figures.joint_mrad:.2f}",
            f"{figures.jitter:.2f}",
            f"{100 * figures.contact_steps:.1f} %",
            f"{figures.objective:.2f}",
        )
    _console().print(table)


def _console() -> Console:
    from rich.console import Console

    return Console()


def _say(text: str) -> None:
    _console().print(text, soft_wrap=True)


@contextmanager
def _bar(words: str) -> Iterator[Callable[[float], None]]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        bar = progress.add_task(words, total=1.0)
        yield lambda share: progress.update(bar, completed=share)
