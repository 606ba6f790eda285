"""How figures of agents are shown: one table, with what ``J`` is below it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from syda_gym.cli.shared import show_table

if TYPE_CHECKING:
    from syda_gym.agents.figures import Figures

__all__ = ["print_figures"]


def print_figures(rows: Mapping[str, Figures], title: str) -> None:
    """Prints one row an agent."""
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
