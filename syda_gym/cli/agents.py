"""The commands that deal with agents: ``train``, ``evaluate``, ``play`` and ``export``; registered by ``cli``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from syda_gym.cli.shared import DEFAULT_VIEW, AppearanceOption, ViewAddressOption, ViewOption, console

if TYPE_CHECKING:
    from syda_gym.agents.figures import Figures

__all__ = ["evaluate", "export", "play", "train"]

SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.", min=0)]


@dataclass(frozen=True)
class Scene:
    """The environment that a command acts in, as its user described it; the fields are options of the command."""

    motions: Annotated[str, typer.Option("--motions", "-m", help="`embedded`, `paper:DIR`, ...", metavar="SPEC")] = (
        "embedded"
    )
    operator: Annotated[str, typer.Option(help="Who leads.")] = "adult"
    robot: Annotated[str, typer.Option(help="Who follows.")] = "pepper"
    route: Annotated[str, typer.Option(help="`auto`, or bodies such as `adult,kid,pepper`.")] = "auto"
    mapping: Annotated[str, typer.Option(help="Method of the mapping, or a folder of stored ones.")] = "syda"
    disturbances: Annotated[
        str, typer.Option(help="`none`, `teleop:CELL:LEVEL` or a single one such as `link:test`.")
    ] = "none"
    reference: Annotated[str, typer.Option(help="`paired`: the robot's own motion; `mapped`: the clean mapping.")] = (
        "paired"
    )
    held_out: Annotated[
        str, typer.Option(help="Actions, comma-separated: left out of fits and training, or played.")
    ] = ""

    def options(self, *, training: bool = False) -> dict[str, Any]:
        """Environment options; held-out actions are kept out of fits and, if ``training``, out of the motions."""
        options: dict[str, Any] = {
            "motions": self.motions,
            "operator": self.operator,
            "robot": self.robot,
            "route": self.route if self.route == "auto" else tuple(self.route.replace(">", ",").split(",")),
            "mapping": self.mapping,
            "disturbances": None if self.disturbances == "none" else self.disturbances,
            "reference": self.reference,
        }
        names = tuple(name for name in self.held_out.split(",") if name)
        if names:
            options["held_out"] = names
            options["actions"] = names
            if training:
                from syda_gym.motions.loading import load_motions

                known = {take.action for take in load_motions(self.motions).takes}
                options["actions"] = tuple(sorted(known - set(names)))
        return options


def with_scene(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command that takes ``scene`` the options of a ``Scene`` in its place."""
    hints = get_type_hints(Scene, include_extras=True)
    scene = [
        Parameter(field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name])
        for field in fields(Scene)
    ]
    own = signature(command, eval_str=True)

    @wraps(command)
    def run(**given: Any) -> None:
        command(scene=Scene(**{field.name: given.pop(field.name) for field in fields(Scene)}), **given)

    kept = [parameter for name, parameter in own.parameters.items() if name != "scene"]
    parameters = [*(parameter.replace(kind=Parameter.KEYWORD_ONLY) for parameter in kept), *scene]
    # Typer reads both.
    run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


@with_scene
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
    seed: SeedOption = 0,
    *,
    scene: Scene,
) -> None:
    """Train a residual policy or a predictor, beside what it stands on."""
    from syda_gym.agents.predictor.predictor_training import PredictorConfig
    from syda_gym.agents.residual.config import ResidualConfig
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
    options = scene.options(training=True)
    with _bar("Training") as tell:
        report = train_agent(options, out, config=config, base=base, seed=seed, resume=resume, progress=tell)
    rows = {}
    for place, (step, figures, below) in enumerate(report.history):
        mark = "  (kept)" if place == report.best else ""
        rows[f"after {step}{mark}"] = figures
        last = below
    _print_figures({"what it stands on": last, **rows}, "Validation episodes, servo model")
    _say(f"stored: [bold]{report.bundle}[/]  (logs and checkpoint beside it; tensorboard --logdir {out})")


@with_scene
def evaluate(
    agents: Annotated[list[str], typer.Argument(help="Bundles, shipped agents or rivals' names.")],
    physics: Annotated[str, typer.Option(help="`bullet` or `servo`.")] = "bullet",
    draws: Annotated[int, typer.Option(help="Episodes per clip.", min=1)] = 1,
    clips: Annotated[int, typer.Option(help="Number of clips, spread over all; 0 plays all.", min=0)] = 0,
    physics_hz: Annotated[float, typer.Option(help="Physics steps per second.")] = 240.0,
    seed: SeedOption = 0,
    *,
    scene: Scene,
) -> None:
    """Play agents beside the base alone, on the same episodes."""
    import numpy as np

    from syda_gym.agents.work import compare_agents, mean_table
    from syda_gym.envs.teleop import SydaTeleopEnv

    options = scene.options() | {"physics": physics, "physics_hz": physics_hz}
    chosen: list[int | str] | None = None
    if clips:
        env = SydaTeleopEnv(**options)
        chosen = list(np.linspace(0, len(env.clip_names) - 1, clips).round().astype(int).tolist())
        env.close()
    with _bar("Playing") as tell:
        results = compare_agents(options, agents, clips=chosen, draws=draws, seed=seed, progress=tell)
    count = len(next(iter(results.values())))
    _print_figures(mean_table(results), f"Means over {count} episodes, {physics}, disturbances {scene.disturbances}")


@with_scene
def play(
    agent: Annotated[str, typer.Argument(help="A bundle, a shipped agent or a rival's name.")] = "base",
    out: Annotated[Path, typer.Option("--out", "-o", help="Video to write.")] = Path("play.mp4"),
    clip: Annotated[str, typer.Option(help="Name or number of the clip.")] = "0",
    physics_hz: Annotated[float, typer.Option(help="Physics steps per second.")] = 240.0,
    seed: SeedOption = 0,
    view: ViewOption = False,
    view_address: ViewAddressOption = DEFAULT_VIEW,
    appearance: AppearanceOption = None,
    *,
    scene: Scene,
) -> None:
    """Play one episode in Bullet and film it: operator, robot, and where it should be as a ghost."""
    from syda_gym.agents.work import film

    options = scene.options() | {"physics_hz": physics_hz}
    if view:
        from syda_gym.agents.work import play_episode
        from syda_gym.cli.viewing import view_episode

        played = play_episode(options, agent, clip=int(clip) if clip.isdigit() else clip, seed=seed)
        _print_figures({agent: played.figures}, f"Clip {clip}")
        view_episode(played, f"{agent}, clip {clip}", view_address, appearance)
        return
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
    console().print(table)


def _say(text: str) -> None:
    console().print(text, soft_wrap=True)


@contextmanager
def _bar(words: str) -> Iterator[Callable[[float], None]]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        bar = progress.add_task(words, total=1.0)
        yield lambda share: progress.update(bar, completed=share)
