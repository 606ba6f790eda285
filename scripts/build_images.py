"""Draws the pictures of README and gallery.

    python scripts/build_images.py [chain] [environment] [--out docs/images]

``chain``: operator, kid and Pepper in a row, moving, on an action that was not fitted. ``environment``: what
``SydaTeleop-v0`` renders for Pepper and for NAO, and how the joints of one episode follow.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium as gym
import numpy as np
from PIL import Image

import syda_gym
from syda_gym.envs.plots import tracking_figure
from syda_gym.evaluation.drawing import draw
from syda_gym.evaluation.report.figures import track
from syda_gym.files import atomic_path

ROUTE = ("adult", "kid", "pepper")
LABELS = ("adult, synthetic motion", "kid, by the first mapping", "Pepper, by the second")
ACTION = "wave_both"
FPS = 15.0


def main() -> None:
    """Draws what is asked for; everything by default."""
    parts = {"chain": chain, "environment": environment}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="which pictures; all by default")
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    options = parser.parse_args()
    for name in options.parts or parts:
        parts[name](options.out)


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
    pictures = [Image.fromarray(draw(tracks, t, labels=LABELS, size=(900, 420))) for t in range(len(frames[0]))]
    with atomic_path(folder / "chain.webp") as temporary:
        pictures[0].save(
            temporary,
            save_all=True,
            append_images=pictures[1:],
            duration=round(1000 / FPS),
            loop=0,
            quality=72,
            method=6,
        )
    save(pictures[len(pictures) // 3], folder / "chain.png")


def environment(folder: Path) -> None:
    """Plays an episode without corrections for each robot, keeps three moments, and plots the joints of Pepper's."""
    rows = []
    for robot, route in (("pepper", ("adult", "kid", "pepper")), ("nao", ("adult", "nao"))):
        env = gym.make("SydaTeleop-v0", robot=robot, route=route, render_mode="rgb_array")
        _, info = env.reset(seed=0, options={"motion": "archer-01"})
        nothing = np.zeros(env.action_space.shape, dtype=np.float32)
        pictures, infos = [env.render()], [info]
        done = False
        while not done:
            _, _, terminated, truncated, info = env.step(nothing)
            infos.append(info)
            pictures.append(env.render())
            done = terminated or truncated
        rows.append(np.hstack([pictures[round(share * (len(pictures) - 1))] for share in (0.2, 0.45, 0.7)]))
        if robot == "pepper":
            figure = tracking_figure(env.unwrapped.robot, infos[1:], env.unwrapped.dt)
            with atomic_path(folder / "tracking.png") as temporary:
                figure.savefig(temporary, dpi=80)
        env.close()
    save(Image.fromarray(np.vstack(rows)), folder / "environment.png")


def save(picture: Image.Image, path: Path) -> None:
    """Writes a PNG of 256 colours, which is small enough for a repository."""
    with atomic_path(path) as temporary:
        picture.convert("P", palette=Image.Palette.ADAPTIVE, colors=256).save(temporary, optimize=True)
    print(f"{path}: {path.stat().st_size >> 10} kB")


if __name__ == "__main__":
    main()
