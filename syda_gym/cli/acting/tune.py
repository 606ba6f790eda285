"""The command ``tune``: settings of the classical agents for the user's own motions and disturbances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from syda_gym.cli import checks
from syda_gym.cli.acting.scene import Scene, with_scene
from syda_gym.cli.names import RIVALS, ticked
from syda_gym.cli.options import JsonOption, SeedOption
from syda_gym.cli.shared import bar, print_json, say_written, show_table

__all__ = ["tune"]


@with_scene
def tune(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help=f"Which, out of {ticked(RIVALS)}; all but those against contacts by default.",
            metavar="[RIVAL]...",
            callback=checks.several(RIVALS, "rival"),
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of the tuned agents, a bundle each.", callback=checks.folder)
    ] = Path("tuned"),
    count: Annotated[
        int, typer.Option("--training-episodes", help="Episodes to tune on, spread over the clips.", min=1)
    ] = 36,
    budget: Annotated[int, typer.Option(help="Settings to try for each.", min=1)] = 32,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
    *,
    scene: Scene,
) -> None:
    """Tune classical agents on your motions and disturbances, in the servo model, and store them."""
    from syda_gym.agents.classical.rivals import CONTACT_RIVALS
    from syda_gym.agents.figures import OBJECTIVE
    from syda_gym.agents.work import tune_rivals

    chosen = names or [name for name in RIVALS if name not in CONTACT_RIVALS]
    options = scene.options(training=True)
    with bar("Tuning") as tell:
        found = tune_rivals(options, chosen, episodes=count, budget=budget, seed=seed, out=out, progress=tell)
    if as_json:
        print_json(
            {
                name: {
                    "settings": dict(rival.tuned.settings),
                    "training": rival.tuned.figures.as_dict(),
                    "validation": rival.after.as_dict(),
                    "validation_as_shipped": rival.before.as_dict(),
                }
                for name, rival in found.items()
            }
        )
        return
    rows = [
        (
            name,
            ", ".join(f"{key} {value:.3g}" for key, value in rival.tuned.settings.items()) or "none",
            f"{rival.tuned.figures.objective:.2f}",
            f"{rival.after.objective:.2f}",
            f"{rival.before.objective:.2f}",
        )
        for name, rival in sorted(found.items(), key=lambda item: item[1].after.objective)
    ]
    headings = ("agent", "settings", "J, training", "J, validation", "J, validation, as shipped")
    show_table(headings, rows, title=f"Disturbances {scene.disturbances}", note=OBJECTIVE)
    best = rows[0][0]
    say_written("stored", out, f"(use one by its path: syda-gym train --base {out / best})")
