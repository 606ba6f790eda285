"""The commands that deal with agents: ``train``, ``evaluate``, ``play`` and ``export``; registered by ``cli``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.cli import checks
from syda_gym.cli.acting.figures import print_figures
from syda_gym.cli.acting.scene import Scene, with_scene
from syda_gym.cli.names import ALGORITHMS, CONFIGS, KINDS, PHYSICS, STACK, ticked
from syda_gym.cli.options import (
    AGENT_HELP,
    DEFAULT_VIEW,
    AppearanceOption,
    JsonOption,
    PhysicsHzOption,
    SeedOption,
    ViewAddressOption,
    ViewOption,
)
from syda_gym.cli.shared import bar, console, interruptible, print_json, say_written

if TYPE_CHECKING:
    from syda_gym.agents.training import Comparison
    from syda_gym.agents.work import TrainingReport

__all__ = ["evaluate", "export", "play", "train"]


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
            help=f"Hyper-parameters of the residual policy: {ticked(CONFIGS)}, or a YAML file of your own. Default: "
            "`undisturbed` without disturbances, else `teleop`.",
            metavar="NAME|FILE",
            callback=checks.named_or_file(CONFIGS, "training configuration", ".yaml", ".yml"),
        ),
    ] = "",
    algorithm: Annotated[
        str,
        typer.Option(
            help=f"{ticked(ALGORITHMS)}; by default the configuration's.",
            callback=checks.one_of(ALGORITHMS, "algorithm"),
        ),
    ] = "",
    steps: Annotated[int, typer.Option(help="Environment steps, or iterations; 0 for the configuration's.", min=0)] = 0,
    base: Annotated[
        str,
        typer.Option(
            help="What it stands on. Default: what the configuration names, as a rule `stack`: a predictor, trained "
            f"first, on the Kalman filter tuned for the disturbances. {AGENT_HELP}",
            metavar="AGENT",
            callback=checks.agents_or(STACK),
        ),
    ] = "",
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint in the folder.")] = False,
    seed: SeedOption = 0,
    *,
    scene: Scene,
) -> None:
    """Train a residual policy or a predictor, beside base, lead, tuned Kalman filter and what it stands on."""
    from syda_gym.agents.predictor.predictor_training import PredictorConfig
    from syda_gym.agents.residual.config import ResidualConfig
    from syda_gym.agents.work import default_config, train_agent

    options = scene.options(training=True)
    settings: Any
    if kind == "predictor":
        settings = PredictorConfig(iterations=steps) if steps else PredictorConfig()
    else:
        changes: dict[str, Any] = {"algorithm": algorithm} if algorithm else {}
        changes |= {"steps": steps} if steps else {}
        if config:
            settings = (ResidualConfig.preset if config in CONFIGS else ResidualConfig.read)(config, **changes)
        else:
            settings = ResidualConfig.of({**default_config(options).as_dict(), **changes})
    with interruptible(lambda: _where_to_go_on(out, kind)), bar("Training") as tell:
        report = train_agent(options, out, config=settings, base=base, seed=seed, resume=resume, progress=tell)
    rows = {}
    for place, (step, figures, below) in enumerate(report.history):
        mark = "  (kept)" if place == report.best else ""
        rows[f"after {step}{mark}"] = figures
        last = below
    print_figures({"what it stands on": last, **rows}, "Validation episodes, servo model")
    print_figures(report.comparison.figures, "The same episodes, beside the others")
    say_written("stored", report.bundle, f"(logs and checkpoint beside it; tensorboard --logdir {out})")
    _print_verdict(report)


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
    print_figures(means, f"Means over {count} episode{'s' * (count > 1)}, {physics}, disturbances {scene.disturbances}")


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
        print_figures({agent: played.figures}, f"Clip {clip}")
        view_episode(played, f"{agent}, clip {clip}", view_address, appearance)
        return
    with interruptible("no film was written; run the command again"), bar("Filming") as tell:
        figures = film(options, agent, out, clip=int(clip) if clip.isdigit() else clip, seed=seed, progress=tell)
    print_figures({agent: figures}, f"Clip {clip}")
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


def _print_verdict(report: TrainingReport) -> None:
    """Whether anything was gained, by the run's own cost, and against the best of the others."""
    comparison, say = report.comparison, console()
    if report.best == 0:
        say.print(
            f"nothing was gained: the base is kept; try {advice(comparison)}",
            style="bold red", markup=False, soft_wrap=True,
        )  # fmt: skip
        return
    mine, other = (comparison.cost.of_figures(comparison.figures[n]) for n in (comparison.mine, comparison.best_other))
    if comparison.gained:
        words = (
            f"gained: cost {mine:.2f}, {100 * (1 - mine / other):.1f} % less than the best of the others "
            f"({comparison.best_other}, {other:.2f})"
        )
        say.print(words, style="bold green", markup=False, soft_wrap=True)
    else:
        words = (
            f"{comparison.best_other!r} is better without training ({other:.2f} against {mine:.2f}); take it, or try "
            f"{_other_trainings(comparison)}"
        )
        say.print(words, style="bold red", markup=False, soft_wrap=True)


def advice(comparison: Comparison) -> str:
    """What to try after a training that gained nothing."""
    return f"{_other_trainings(comparison)}, or take `{comparison.best_other}`, the best of the others, as it is"


def _other_trainings(comparison: Comparison) -> str:
    on_predictor = any("predictor" in name for name in comparison.figures)
    return "more --steps, another --seed" if on_predictor else "--base stack, more --steps"


def _where_to_go_on(out: Path, kind: str) -> str:
    """What an interrupted training left."""
    if kind == "residual" and (out / "checkpoint.safetensors").is_file():
        from syda_gym.agents.residual.checkpoint import load_checkpoint

        steps = load_checkpoint(out / "checkpoint.safetensors")[1]["state"]["history"][-1]["steps"]
        return f"the checkpoint in {out} stands at {steps} steps; the same command with --resume goes on from there"
    return "nothing was kept yet; run the command again"
