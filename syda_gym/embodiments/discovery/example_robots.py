"""Real robots of other makers: the URDFs of the PyPI package ``example-robot-data`` (extra ``robots``)."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

from syda_gym.embodiments.discovery.arms import discover
from syda_gym.embodiments.robot import RobotDescription
from syda_gym.errors import EmbodimentError, MissingExtraError

__all__ = ["example_urdfs", "two_armed_robots"]

_PACKAGE = "example-robot-data"


def example_urdfs() -> dict[str, Path]:
    """File name without ending to path of every URDF in the package; of equal names the first.

    Raises:
        MissingExtraError: the package is not installed.
    """
    try:
        files = metadata.files(_PACKAGE) or []
    except metadata.PackageNotFoundError as error:
        raise MissingExtraError("the robots of other makers", "robots") from error
    found: dict[str, Path] = {}
    for file in sorted(files, key=str):
        if file.suffix == ".urdf":
            found.setdefault(file.stem, Path(str(file.locate())).resolve())
    return found


def two_armed_robots() -> dict[str, RobotDescription]:
    """Every robot of the package in which a left and a right arm are found, by file name.

    Raises:
        MissingExtraError: the package is not installed.
    """
    robots = {}
    for name, path in example_urdfs().items():
        try:
            description = discover(path)
        except EmbodimentError:
            continue  # quadrupeds, drones, single hands, files that no parser takes
        if len(description.arms) == 2:
            robots[name] = description
    return robots
