"""The validation study as a picture: what was predicted against what came."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from syda_gym.errors import OptionError, nearest_name
from syda_gym.evaluation.prediction.results import PredictionStudy
from syda_gym.look import OPERATOR, ROBOT, plot_theme

__all__ = ["prediction_png"]

_COLORS = (OPERATOR, ROBOT, "#8fb0ea", "#b9c2cd")  # of one hop and more; to be told from white and from black


def prediction_png(
    study: PredictionStudy,
    predictors: Sequence[str] = ("T", "hops", "dry_run", "measured"),
    width: float = 13.0,
    ground: str = "day",
) -> bytes:
    """Scatters the held-out error of every route over the rank of its prediction, one panel a predictor.

    Args:
        study: from ``validate``.
        predictors: which ones.
        width: inches, at 100 dots per inch.
        ground: ``"day"`` for light pages, ``"night"`` for dark ones, ``"dusk"`` for both (see ``look.plot_theme``).

    Returns:
        PNG bytes.

    Raises:
        OptionError: unknown predictor.
    """
    import matplotlib

    with matplotlib.rc_context(plot_theme(ground)):
        return _drawn(study, predictors, width)


def _drawn(study: PredictionStudy, predictors: Sequence[str], width: float) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from scipy.stats import rankdata

    scores = {score.name: score for score in study.scores}
    for name in predictors:
        if name not in scores:
            raise OptionError(f"the study has no predictor {name!r}; {nearest_name(name, scores)}")
    error = np.array([route.error for route in study.routes])
    hops = np.array([route.hops for route in study.routes])
    figure = Figure(figsize=(width, 0.34 * width), dpi=100, layout="constrained")
    panels = figure.subplots(1, len(predictors), sharey=True, squeeze=False)[0]
    for axis, name in zip(panels, predictors, strict=True):
        rank = rankdata([-route.predicted[name] for route in study.routes]) / len(study.routes)
        for count in range(int(hops.max()), 0, -1):
            shown = hops == count
            label = f"{count} hop{'s' if count > 1 else ''}"
            color = _COLORS[min(count, len(_COLORS)) - 1]
            axis.scatter(rank[shown], error[shown], s=9 if count > 1 else 16, color=color, linewidths=0, label=label)
        best = scores[name]
        axis.set_title(f"{name}\nall {best.all.value:.2f}, choice {best.choice.value:.2f}", fontsize=10)
        axis.set_xlabel("rank, best predicted first", fontsize=9)
        axis.set_xlim(-0.03, 1.03)
        axis.tick_params(labelsize=8)
    panels[0].set_ylabel("held-out error / target's arm length", fontsize=9)
    panels[-1].legend(fontsize=8, loc="upper left", markerscale=1.8)
    kind = "synthetic motions" if study.synthetic else study.motions
    figure.suptitle(f"{len(study.routes)} routes among {len(study.bodies)} bodies, {kind}", fontsize=11)
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
