"""For ``in_child``: the points of a C3D file as plain arrays."""

from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

__all__ = ["arrays"]

_MOST = 24_000_000  # numbers


def arrays(path: Path) -> dict[str, Any]:
    """Points ``(N, points, 3)`` in the file's unit, NaN where a marker was not seen; labels, rate and unit."""
    file = ezc3d.c3d(str(path))
    points = np.asarray(file["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    group = file["parameters"]["POINT"]
    labels = [str(label) for label in group["LABELS"]["value"]][: points.shape[1]]
    for number in range(2, 6):  # more than 255 points: further lists
        labels += [str(label) for label in group.get(f"LABELS{number}", {"value": []})["value"]]
    residual = np.asarray(file["data"]["meta_points"]["residuals"])[0].T
    points = np.where((residual < 0)[:, :, None] | (points == 0).all(axis=2)[:, :, None], np.nan, points)
    rate = float(np.ravel(group["RATE"]["value"])[0])
    units = str((list(group.get("UNITS", {"value": [""]})["value"]) or [""])[0])
    if points.size > _MOST:
        raise ValueError(f"{points.size} numbers; at most {_MOST} are read")
    names = np.array([label[:100] for label in labels[: points.shape[1]]] or [""], dtype="U100")
    return {"points": points, "labels": names, "rate": np.array(rate), "units": np.array([units], dtype="U20")}
