"""Draws the pictures of README and gallery, on a ground that stands on light pages and on dark ones.

    python scripts/build_images.py [first-screen] [chain] [environment] [clouds] [graph] [--out docs/images]

``first-screen``: a person and Pepper following, the one moving picture of README. ``chain``: operator, kid and Pepper
in a row, moving, on an action that was not fitted. ``environment``: what ``SydaTeleop-v0`` renders for Pepper and for
NAO, and how the joints of one episode follow. ``clouds``: where an adult's arm and Pepper's move. ``graph``: bodies,
fitted pairs and the chosen route.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import syda_gym
from syda_gym.envs.plots import tracking_figure
from syda_gym.evaluation.drawing import draw
from syda_gym.evaluation.report.figures import track
from syda_gym.files import atomic_path, write_bytes
from syda_gym.look import GROUNDS, plot_theme

GROUND = "dusk"
ROUTE = ("adult", "kid", "pepper")
LABELS = ("adult, synthetic motion", "kid, by the first mapping", "Pepper, by the second")
ACTION = "wave_both"
FPS = 15.0
FIRST_SCREEN = ("reach_split-01", "wave_in_turn-01")
SIZE = (720, 450)
FINER = 1.5  # drawn so much larger first: the renderer's edges are jagged
WORDS = (("Pepper, simulated", "violet: where it is asked to be"), ("a person", "(synthetic motion)"))
MOST_BYTES = 2_500_000
FITTED = [("adult", "kid"), ("kid", "pepper"), ("pepper", "nao"), ("adult", "tall"), ("tall", "pepper"),
          ("kid", "stiff"), ("stiff", "pepper")]  # fmt: skip


def main() -> None:
    """Draws what is asked for; everything by default."""
    parts = {
        "first-screen": first_screen,
        "chain": chain,
        "environment": environment,
        "clouds": clouds,
        "graph": graph,
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="which pictures; all by default")
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    options = parser.parse_args()
    for name in options.parts or parts:
        parts[name](options.out)


def first_screen(folder: Path) -> None:
    """Two gestures of a person and Pepper's answer in the physics, by the mapping that needs no recordings."""
    width, height = (round(FINER * side) for side in SIZE)
    camera = {"width": width, "height": height, "ground": GROUND, "error": False, "pitch": 6.0, "yaw": -14.0,
              "distance": 2.8}  # fmt: skip
    env = gym.make(
        "SydaTeleop-v0", route=("adult", "pepper"), mapping="geometric", reference="mapped", render_mode="rgb_array",
        camera=camera,
    )  # fmt: skip
    pictures = []
    every = round(1.0 / (FPS * env.unwrapped.dt))
    for motion in FIRST_SCREEN:
        for step, (picture, _) in enumerate(episode(env, motion, every)):
            if step % every == 0:
                pictures.append(with_words(picture, WORDS))
    env.close()
    save_moving(pictures, folder / "first_screen.webp")


def episode(env: Any, motion: str, every: int = 1) -> Any:
    """Picture (of every ``every``-th step; of others the last one) and info of each step, without corrections."""
    _, info = env.reset(seed=0, options={"motion": motion})
    nothing = np.zeros(env.action_space.shape, dtype=np.float32)
    picture, step, done = env.render(), 0, False
    yield picture, info
    while not done:
        _, _, terminated, truncated, info = env.step(nothing)
        done, step = terminated or truncated, step + 1
        picture = env.render() if step % every == 0 else picture
        yield picture, info


def with_words(picture: Any, words: Sequence[Sequence[str]]) -> Image.Image:
    """What is seen, in the lower corners."""
    image = Image.fromarray(picture).resize(SIZE, Image.Resampling.LANCZOS)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(size=15)
    ink = tuple(round(255 * part) for part in GROUNDS[GROUND].ink)
    for place, side, lines in ((14, "l", words[0]), (image.width - 14, "r", words[1])):
        for row, text in enumerate(reversed(lines)):
            pen.text((place, image.height - 14 - 20 * row), text, fill=ink, font=font, anchor=f"{side}s")
    return image


def chain(folder: Path) -> None:
    """Fits both links without the shown action and draws one performance of it."""
    motions = syda_gym.load_motions("embedded", fps=FPS)
    fewer = syda_gym.load_motions("embedded", fps=5)  # neighbouring frames teach nothing new
    links = [
        syda_gym.fit(fewer.pair(a, b).without_actions([ACTION]), seed=0)
        for a, b in zip(ROUTE[:-1], ROUTE[1:], strict=True)
    ]
    frames = [motions.pair(ROUTE[0], ROUTE[-1]).only_actions([ACTION]).clips()[0].source.frames]
    for link in links:
        frames.append(link(frames[-1]))
    tracks = [track(syda_gym.embodiment(name), rows) for name, rows in zip(ROUTE, frames, strict=True)]
    save_moving(
        [
            Image.fromarray(draw(tracks, t, labels=LABELS, size=(900, 420), ground=GROUND))
            for t in range(len(frames[0]))
        ],
        folder / "chain.webp",
    )


def environment(folder: Path) -> None:
    """Plays an episode without corrections for each robot, keeps three moments, and plots the joints of Pepper's."""
    rows = []
    for robot, route in (("pepper", ("adult", "kid", "pepper")), ("nao", ("adult", "nao"))):
        env = gym.make("SydaTeleop-v0", robot=robot, route=route, render_mode="rgb_array", camera={"ground": GROUND})
        shown = list(episode(env, "archer-01", every=8))
        rows.append(np.hstack([shown[round(share * (len(shown) - 1))][0] for share in (0.2, 0.45, 0.7)]))
        if robot == "pepper":
            infos = [info for _, info in shown[1:]]
            with matplotlib.rc_context(plot_theme(GROUND)), atomic_path(folder / "tracking.png") as temporary:
                tracking_figure(env.unwrapped.robot, infos, env.unwrapped.dt).savefig(temporary, dpi=80)
        env.close()
    save(Image.fromarray(np.vstack(rows)), folder / "environment.png")


def clouds(folder: Path) -> None:
    """Where an adult's arm moves, where Pepper's does, and where Pepper can stand in."""
    from syda_gym.routes.pictures import clouds_png

    write_bytes(folder / "transferability-clouds.png", clouds_png("adult", "pepper", ground=GROUND))


def graph(folder: Path) -> None:
    """Fitted pairs among six bodies, and the route from the adult to NAO that the general definition chooses."""
    from syda_gym.routes.pictures import graph_png
    from syda_gym.routes.routing import BodyGraph, best_route

    bodies = syda_gym.load_motions("embedded").bodies
    pairs = [(bodies[a], bodies[b]) for a, b in FITTED]
    drawn = graph_png(BodyGraph((), pairs, "general"), best_route("adult", "nao", pairs, "general"), ground=GROUND)
    write_bytes(folder / "transferability-graph.png", drawn)


def save_moving(pictures: Sequence[Image.Image], path: Path) -> None:
    """Writes a moving picture that begins again, as good as its size allows.

    Raises:
        SystemExit: it would be larger than a page should load.
    """
    with atomic_path(path) as temporary:
        pictures[0].save(
            temporary,
            format="WEBP",
            save_all=True,
            append_images=list(pictures[1:]),
            duration=round(1000 / FPS),
            loop=0,
            quality=76,
            method=6,
        )
        if temporary.stat().st_size > MOST_BYTES:
            raise SystemExit(f"{path}: {temporary.stat().st_size} bytes; at most {MOST_BYTES}")
    print(f"{path}: {len(pictures)} pictures, {len(pictures) / FPS:.1f} s, {path.stat().st_size >> 10} kB")


def save(picture: Image.Image, path: Path) -> None:
    """Writes a PNG of 256 colours, which is small enough for a repository."""
    with atomic_path(path) as temporary:
        picture.convert("P", palette=Image.Palette.ADAPTIVE, colors=256).save(temporary, format="PNG", optimize=True)
    print(f"{path}: {path.stat().st_size >> 10} kB")


if __name__ == "__main__":
    main()
