"""Two more parts of the paper's study: few recordings, and causal windows with their controls."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from syda_gym.evaluation.paper.cells import OTHER, ROBOT
from syda_gym.evaluation.paper.few_shot import few_shot
from syda_gym.evaluation.pools import Tell
from syda_gym.mappings.fitting.windows import window_study
from syda_gym.motions.loading import load_motions

__all__ = ["WINDOW", "FewShotTask", "WindowTask"]

WINDOW = 4
"""Past frames of the window in the study."""


@dataclass(frozen=True)
class FewShotTask:
    """Chain against direct pair for a newcomer with few recordings.

    Attributes:
        spec: the motions.
        newcomer: the human with few recordings; the other one is known.
        seeds: draws of the recordings.
    """

    spec: str
    newcomer: str
    seeds: int

    @property
    def name(self) -> str:
        """For progress and files."""
        return f"few-shot {self.newcomer}"

    @property
    def cost(self) -> float:
        """Relative time."""
        return 12.0

    def compute(self, tell: Tell = lambda fraction: None) -> dict[str, Any] | str:
        """Rows of ``few_shot.FewShotRow``; ``tell`` is told the finished fraction."""
        import torch

        torch.set_num_threads(1)
        rows = few_shot(
            load_motions(self.spec), self.newcomer, OTHER[self.newcomer], ROBOT, draws=self.seeds, progress=tell
        )
        return {"rows": [asdict(row) for row in rows]}


@dataclass(frozen=True)
class WindowTask:
    """Whether past frames help, with the controls.

    Attributes:
        spec: the motions.
        human: who leads.
        seeds: not used; a ridge needs none.
    """

    spec: str
    human: str
    seeds: int

    @property
    def name(self) -> str:
        """For progress and files."""
        return f"windows {self.human}"

    @property
    def cost(self) -> float:
        """Relative time."""
        return 1.0

    def compute(self, tell: Tell = lambda fraction: None) -> dict[str, Any] | str:
        """Rows of ``windows.WindowRow``; it takes seconds, so that ``tell`` is told nothing."""
        rows = window_study(load_motions(self.spec).pair(self.human, ROBOT), WINDOW)
        return {"rows": [asdict(row) for row in rows]}
