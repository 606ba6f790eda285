"""Small workbooks in the layout of the paper's recordings, written for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import openpyxl

HEADER = ("TransX", "TransY", "TransZ", "RotX", "RotY", "RotZ", "RotW")
HUMAN = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")
PEPPER = tuple(side + part for side in "LR" for part in ("Shoulder", "Bicep", "Elbow", "ForeArm", "Hand"))


def write_workbook(path: Path, sheets: Mapping[str, np.ndarray], header: tuple[str, ...] = HEADER) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    book = openpyxl.Workbook()
    book.active.title = "Sheet1"
    for name, table in sheets.items():
        sheet = book.create_sheet(name)
        sheet.append(header)
        for row in table:
            sheet.append([None if np.isnan(value) else float(value) for value in row])
    book.save(path)


def human_sheets(rows: int = 6, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {name: np.hstack([rng.normal(0.0, 0.3, (rows, 3)), np.tile([0, 0, 0, 1.0], (rows, 1))]) for name in HUMAN}


def pepper_sheets(rows: int = 6) -> dict[str, np.ndarray]:
    """Arms at the zero pose: every local rotation is none, but for the elbows' tilt."""
    sheets = {name: np.tile([0, 0, 0, 0, 0, 0, 1.0], (rows, 1)) for name in PEPPER}
    for side in "LR":
        sheets[f"{side}Elbow"][:, 3:] = [0.0, np.sin(-0.157079 / 2), 0.0, np.cos(-0.157079 / 2)]
    return sheets


def write_dataset(root: Path, rows: int = 6) -> Path:
    write_workbook(root / "Pepper" / "pepper_P01A01T01.xlsx", pepper_sheets(rows))
    write_workbook(root / "Pepper2Human" / "human_P01A01T01.xlsx", human_sheets(rows, 1))
    write_workbook(root / "Pepper2Human" / "human_P02A01T02.xlsx", human_sheets(rows, 2))
    write_workbook(root / "HumanAdult2HumanKid" / "human_P01A01T01.xlsx", human_sheets(rows, 3))
    write_workbook(root / "HumanAdult2HumanKid" / "human_P02A01T03.xlsx", human_sheets(rows, 4))
    return root
