"""Shared pieces of the evaluation tests: small motions, a sample report, a headless browser."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.evaluation.report import (
    BarPlot,
    Column,
    CurvePlot,
    Headline,
    Picture,
    Playback,
    PlaybackChain,
    Report,
    RouteEdge,
    RouteGraph,
    Section,
    Table,
    Text,
    track,
)
from syda_gym.evaluation.statistics import Estimate
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import load_motions


@pytest.fixture(scope="session")
def embedded() -> Motions:
    return load_motions("embedded")


@pytest.fixture(scope="session")
def small_motions(embedded: Motions) -> Motions:
    """Two seconds of five actions of adult, kid and Pepper at 10 Hz."""
    slow = load_motions(embedded, fps=10)
    actions = sorted({take.action for take in slow.takes})[::11]
    bodies = ("adult", "kid", "pepper")
    takes = tuple(
        type(take)(take.recording, take.action, take.fps, {b: take.frames[b][8:28] for b in bodies}, take.mirrored)
        for take in slow.takes
        if take.action in actions
    )
    return Motions("small", takes, {b: slow.bodies[b] for b in bodies}, slow.families, synthetic=True)


def sample_playback(motions: Motions, chains: int = 2, frames: int = 40, own_tracks: bool = False) -> Playback:
    """Chains of adult, kid and Pepper; with ``own_tracks`` every chain has another operator motion."""
    take = motions.takes[5]
    shown = {name: track(motions.bodies[name], take.frames[name][:frames]) for name in ("adult", "kid", "pepper")}
    entries = []
    for index in range(chains):
        off = motions.bodies["pepper"].check(take.frames["pepper"][:frames]) + 0.002 * index + 0.1
        route = ["adult", "kid"][: 1 + index % 2]
        if own_tracks:
            moved = 0.001 * index
            shown |= {n: track(motions.bodies[n], take.frames[n][:frames] * (1.0 + moved)) for n in ("adult", "kid")}
        robot = track(motions.bodies["pepper"], off)
        entries.append(
            PlaybackChain(
                f"{'>'.join(route)}>pepper" + (f" #{index}" if index > 1 else ""),
                [*(shown[name] for name in route), robot],
                30.0,
                np.linspace(0.02, 0.08, frames).tolist(),
                shown["pepper"],
                0.11,
                take.recording,
            )
        )
    return Playback("Playback", entries, "Drag to turn.")


@pytest.fixture(scope="session")
def sample_report(embedded: Motions) -> Report:
    def about(value: float) -> Estimate:
        return Estimate(value, 0.9 * value, 1.2 * value, 9)

    names = [f"chain {i} </script><b>" for i in range(14)]
    return Report(
        "A <report> & more",
        "subtitle",
        [Headline("Error", "5.3 cm", "95 % interval", "good"), Headline("Route", "adult > pepper")],
        [
            Section("Play", [sample_playback(embedded)]),
            Section(
                "Numbers",
                [
                    Text("One <paragraph>."),
                    Table(
                        "Errors",
                        [Column("Chain"), Column("E", "cm", 1, 100), Column("n"), Column("ok")],
                        [[name, about((i * 5 % 14) / 100), i, i % 2 == 0] for i, name in enumerate(names)],
                        strong=(3,),
                    ),
                    BarPlot("Bars", "cm", ["a", "b"], {"x": [about(1.0), about(2.0)], "y": [about(3.0), about(0.5)]}),
                    CurvePlot("Curves", "n", "cm", [1, 2, 4], {"x": [about(3.0), about(2.0), about(1.0)]}),
                    RouteGraph(
                        "Graph",
                        {"adult": "human", "kid": "human", "pepper": "robot"},
                        [RouteEdge("adult", "kid", 0.7), RouteEdge("kid", "pepper", 0.4, 0.06)],
                        ("adult", "kid", "pepper"),
                    ),
                ],
            ),
            Section("Pictures", [Picture("A dot", _DOT)]),
        ],
        {"Command": "syda-gym test", "Seed": "0"},
    )


# A white pixel as PNG.
_DOT = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000" + "1f15c4890000000d49444154789c63f8ffff"
    "ff7f0009fb03fd0558e4c50000000049454e44ae426082"
)
