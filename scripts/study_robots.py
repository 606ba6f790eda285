"""Runs arms, metric, routing and pictures on every two-armed robot of the package example-robot-data.

Usage: python scripts/study_robots.py [--table docs/robots-found.md] [--pictures FOLDER]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from syda_gym.embodiments import catalog
from syda_gym.embodiments.discovery.example_robots import example_urdfs, two_armed_robots
from syda_gym.embodiments.robot import Robot
from syda_gym.files import write_bytes, write_text
from syda_gym.routes.metric import Transferability, transferability
from syda_gym.routes.pictures import clouds_png, graph_png
from syda_gym.routes.routing import BodyGraph, Route, best_route

SAMPLES, REPEATS = 2**18, 2

HEADER = """# Arms found in the robots of other makers

What `syda_gym.embodiments.discovery.arms.discover` found, without any hint, in the URDFs of the PyPI package
[`example-robot-data`](https://pypi.org/project/example-robot-data/) {version} (`pip install 'syda-gym[robots]'`):
{two} of its {all} URDFs have two arms. The others are quadrupeds, drones, single arms, single hands and one file that
no parser takes. Written by `scripts/study_robots.py`.

Joints per arm; the links whose origins are shoulder, elbow, wrist and tip (left arm; the right one has its counterparts
in every robot listed); upper arm and forearm; T from the adult to the robot and back (`general` definition); and which
of Pepper and NAO is the better stop on the way from the adult, if a lab has the pairs adult-Pepper, adult-NAO,
Pepper-robot and NAO-robot.

<!-- numbers: this page, written by scripts/study_robots.py -->

| robot | joints | shoulder, elbow, wrist, tip | upper arm, forearm [m] | T from adult | T to adult | best stop |
|---|---|---|---|---|---|---|
"""


def row(name: str, robot: Robot, there: Transferability, back: Transferability, route: Route) -> str:
    """One line of the table."""
    arm = robot.description.arms[0]
    links = ", ".join(f"`{link}`" for link in (arm.shoulder, arm.elbow, arm.wrist, arm.tip))
    upper, fore = robot.arm_lengths[0]
    stop = route.bodies[1] + (" (tie)" if route.ties else "")
    return (
        f"| {name} | {len(arm.joints)} | {links} | {upper:.3f}, {fore:.3f} | {there.T:.3f} | {back.T:.3f} | {stop} |\n"
    )


def main() -> None:
    """Prints and writes the table; fails if a robot fails."""
    from importlib.metadata import version

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path, help="write the table as Markdown")
    parser.add_argument("--pictures", type=Path, help="write clouds and graph of every robot into this folder")
    arguments = parser.parse_args()
    adult = catalog.get("adult")
    robots = two_armed_robots()
    text = HEADER.format(version=version("example-robot-data"), two=len(robots), all=len(example_urdfs()))
    options = {"samples": SAMPLES, "repeats": REPEATS}
    for name, description in robots.items():
        start = time.perf_counter()
        robot = Robot(description)
        there, back = transferability(adult, robot, **options), transferability(robot, adult, **options)
        pairs = [("adult", "pepper"), ("adult", "nao"), ("pepper", robot), ("nao", robot)]
        route = best_route("adult", robot, pairs, **options)
        for term in (there, back):
            assert 0.0 < term.T <= 1.0, (name, term)  # false for NaN too
        clouds = clouds_png(adult, robot, samples=SAMPLES)
        graph = graph_png(BodyGraph((), pairs, **options), route)
        if arguments.pictures:
            write_bytes(arguments.pictures / f"{name}-clouds.png", clouds)
            write_bytes(arguments.pictures / f"{name}-graph.png", graph)
        line = row(name, robot, there, back, route)
        print(f"{time.perf_counter() - start:5.1f} s  {line.strip()}", flush=True)
        text += line
    if arguments.table:
        write_text(arguments.table, text)


if __name__ == "__main__":
    main()
