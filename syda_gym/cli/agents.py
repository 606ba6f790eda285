"""The commands that deal with agents: ``train``, ``evaluate``, ``play`` and ``export``; registered by ``cli``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from syda_gym.cli import checks
from syda_gym.cli.names import ALGORITHMS, CONFIGS, KINDS, PHYSICS, REFERENCES, ticked
from syda_gym.cli.options import (
    AGENT_HELP,
    DEFAULT_VIEW,
    AppearanceOption,
    DisturbancesOption,
    HeldOutOption,
    JsonOption,
    MappingOption,
    MethodOption,
    MotionsOption,
    OperatorOption,
    PhysicsHzOption,
    PresetOption,
    RobotOption,
    RouteOption,
    SeedOption,
    ViewAddressOption,
    ViewOption,
    ends_of,
    mapping_of,
    route_of,
)
from syda_gym.cli.shared import bar, interruptible, print_json, say_written, show_table

if TYPE_CHECKING:
    from syda_gym.agents.figures import Figures

__all__ = ["evaluate", "export", "play", "train"]


@dataclass(frozen=True)
class Scene:
    """The environment that a command acts in, as its user described it; the fields are options of the command."""

    motions: MotionsOption = "embedded"
    operator: OperatorOption = None
    robot: RobotOption = None
    route: RouteOption = "auto"
    method: MethodOption = None
    preset: PresetOption = None
    mapping: MappingOption = None
    disturbances: DisturbancesOption = "none"
    reference: Annotated[
        str,
        typer.Option(
            help="What errors are measured against: `paired`, the robot's own motion, or `mapped`, the clean mapping.",
            callback=checks.one_of(REFERENCES, "reference"),
        ),
    ] = "paired"
    held_out: HeldOutOption = None

    def options(self, *, training: bool = False) -> dict[str, Any]:
        """Environment options; held-out actions are kept out of fits and, if ``training``, out of the motions."""
        mapping, preset = mapping_of(self.method, self.preset, self.mapping)
        operator, robot = ends_of(self.operator, self.robot, self.route)
        options: dict[str, Any] = {
            "motions": self.motions,
            "operator": operator,
            "robot": robot,
            "route": route_of(self.route),
            "mapping": _stored(mapping),
            "preset": preset,
            "disturbances": None if self.disturbances == "none" else self.disturbances,
            "reference": self.reference,
        }
        if self.held_out:
            known = _actions(self.motions, self.held_out)
            options["held_out"] = tuple(self.held_out)
            options["actions"] = tuple(sorted(known - set(self.held_out)) if training else self.held_out)
        return options


def _stored(mapping: str) -> Any:
    """A stored mapping if one file is named; a method or a folder as it is."""
    if not Path(mapping).is_file():
        return mapping
    from syda_gym.mappings.storage import load_mapping

    return load_mapping(mapping)


def _actions(motions: str, names: Sequence[str]) -> set[str]:
    """All actions of the motions, if the named ones are among them."""
    from syda_gym.errors import nearest_name
    from syda_gym.motions.loading import load_motions

    known = {take.action for take in load_motions(motions).takes}
    for name in names:
        if name not in known:
            raise typer.BadParameter(
                f"{motions} has no action {name!r}; {nearest_name(name, known)}", param_hint="'--held-out'"
            )
    return known


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
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of bundle, checkpoint and logs.", callback=checks.folder)
    ] = Path("agent"),
    kind: Annotated[
        str,
        typer.Option(
            help="`residual` (reinforcement learning) or `predictor` (regression).",
            callback=checks.one_of(KINDS, "kind"),
        ),
    ] = "residual",
    config: Annotated[
        str,
        typer.Option(
            help=f"Hyper-parameters of the residual policy: {ticked(CONFIGS)}, or a YAML file of your own.",
            metavar="NAME|FILE",
            callback=checks.named_or_file(CONFIGS, "training configuration", ".yaml", ".yml"),
        ),
    ] = "undisturbed",
    algorithm: Annotated[
        str,
        typer.Option(
            help=f"{ticked(ALGORITHMS)}; by default the configuration's.",
            callback=checks.one_of(ALGORITHMS, "algorithm"),
        ),
    ] = "",
    steps: Annotated[int, typer.Option(help="Environment steps, or iterations; 0 for the configuration's.", min=0)] = 0,
    base: Annotated[
        str, typer.Option(help=f"What it stands on: {AGENT_HELP}", metavar="AGENT", callback=checks.agents)
    ] = "base",
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint in the folder.")] = False,
    seed: SeedOption = 0,
    *,
    scene: Scene,
) -> None:
    """Train a residual policy or a predictor, beside what it stands on."""
    from syda_gym.agents.predictor.predictor_training import PredictorConfig
    from syda_gym.agents.residual.config import ResidualConfig
    from syda_gym.agents.work import train_agent

    settings: Any
    if kind == "predictor":
        settings = PredictorConfig(iterations=steps) if steps else PredictorConfig()
    else:
        changes: dict[str, Any] = {"algorithm": algorithm} if algorithm else {}
        make = ResidualConfig.preset if config in CONFIGS else ResidualConfig.read
        settings = make(config, **changes, **({"steps": steps} if steps else {}))
    options = scene.options(training=True)
    with interruptible(lambda: _where_to_go_on(out, kind)), bar("Training") as tell:
        report = train_agent(options, out, config=settings, base=base, seed=seed, resume=resume, progress=tell)
    rows = {}
    for place, (step, figures, below) in enumerate(report.history):
        mark = "  (kept)" if place == report.best else ""
        rows[f"after {step}{mark}"] = figures
        last = below
    _print_figures({"what it stands on": last, **rows}, "Validation episodes, servo model")
    say_written("stored", report.bundle, f"(logs and checkpoint beside it; tensorboard --logdir {out})")


@with_scene
def evaluate(
    agents: Annotated[list[str], typer.Argument(help=AGENT_HELP, metavar="AGENT...", callback=checks.agents)],
    physics: Annotated[
        str, typer.Option(help=f"{ticked(PHYSICS)}.", callback=checks.one_of(PHYSICS, "physics"))
    ] = "bullet",
    draws: Annotated[int, typer.Option(help="Episodes per clip.", min=1)] = 1,
    clips: Annotated[int, typer.Option(help="Number of clips, spread over all; 0 plays all.", min=0)] = 0,
    physics_hz: PhysicsHzOption = 240.0,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
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
    with interruptible("nothing was kept; run the command again"), bar("Playing") as tell:
        results = compare_agents(options, agents, clips=chosen, draws=draws, seed=seed, progress=tell)
    count = len(next(iter(results.values())))
    means = mean_table(results)
    if as_json:
        print_json({"episodes": count, "agents": {name: figures.as_dict() for name, figures in means.items()}})
        return
    _print_figures(
        means, f"Means over {count} episode{'s' * (count > 1)}, {physics}, disturbances {scene.disturbances}"
    )


@with_scene
def play(
    agent: Annotated[str, typer.Argument(help=AGENT_HELP, callback=checks.agents)] = "base",
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Video to write (.mp4).", callback=checks.ending(".mp4"))
    ] = Path("play.mp4"),
    clip: Annotated[str, typer.Option(help="Name or number of the clip.")] = "0",
    physics_hz: PhysicsHzOption = 240.0,
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

        with bar("Playing") as tell:
            played = play_episode(options, agent, clip=int(clip) if clip.isdigit() else clip, seed=seed)
            tell(1.0)
        _print_figures({agent: played.figures}, f"Clip {clip}")
        view_episode(played, f"{agent}, clip {clip}", view_address, appearance)
        return
    with interruptible("no film was written; run the command again"), bar("Filming") as tell:
        figures = film(options, agent, out, clip=int(clip) if clip.isdigit() else clip, seed=seed, progress=tell)
    _print_figures({agent: figures}, f"Clip {clip}")
    say_written("video", out)


def export(
    bundle: Annotated[str, typer.Argument(help="A bundle's path or a shipped agent.", callback=checks.bundle)],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="ONNX file to write; a card of it as JSON beside.", callback=checks.ending(".onnx")
        ),
    ] = Path("agent.onnx"),
    mapping: Annotated[
        Path | None,
        typer.Option(help="A stored mapping; by default the one beside the bundle, or the shipped one."),
    ] = None,
    agent_only: Annotated[bool, typer.Option("--agent-only", help="Leave the mapping out.")] = False,
) -> None:
    """Write mapping and agent as one ONNX graph and check that it commands the same."""
    from syda_gym.agents.work import export_bundle

    difference = export_bundle(bundle, out, mapping=mapping, agent_only=agent_only)
    say_written("graph", out, f"largest difference from the original {difference:.1e} rad")
    say_written("card of its inputs and outputs", f"{out}.json")


def _print_figures(rows: Mapping[str, Figures], title: str) -> None:
    from syda_gym.agents.figures import OBJECTIVE

    headings = ("agent", "landmark error [mm]", "joint error [mrad]", "jitter [mm/frame³]", "contacts [%]", "J")
    cells = (
        (
            name,
            f"{figures.landmark_mm:.2f}",
            f"{figures.joint_mrad:.2f}",
            f"{figures.jitter:.2f}",
            f"{100 * figures.contact_steps:.1f}",
            f"{figures.objective:.2f}",
        )
        for name, figures in rows.items()
    )
    show_table(headings, cells, title=title, note=OBJECTIVE)


def _where_to_go_on(out: Path, kind: str) -> str:
    """What an interrupted training left."""
    if kind == "residual" and (out / "checkpoint.safetensors").is_file():
        from syda_gym.agents.residual.checkpoint import load_checkpoint

        steps = load_checkpoint(out / "checkpoint.safetensors")[1]["steps"]
        return f"the checkpoint in {out} stands at {steps} steps; the same command with --resume goes on from there"
    return "nothing was kept yet; run the command again"
