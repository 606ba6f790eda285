"""Draws the moving picture of the README: operator, kid and Pepper in a row, on an action that was not fitted.

python scripts/build_images.py [--action NAME] [--out docs/images/chain.webp]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image

import syda_gym
from syda_gym.evaluation.drawing import draw
from syda_gym.evaluation.report.figures import track
from syda_gym.files import atomic_path

ROUTE = ("adult", "kid", "pepper")
LABELS = ("adult, synthetic motion", "kid, by the first mapping", "Pepper, by the second")
SIZE = (900, 420)
FPS = 15.0


def main() -> None:
    """Fits both links without the shown action and draws one performance of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--action", default="wave_both", help="the action to show; it is left out of fitting")
    parser.add_argument("--out", type=Path, default=Path("docs/images/chain.webp"))
    options = parser.parse_args()
    motions = syda_gym.load_motions("embedded", fps=FPS)
    fewer = syda_gym.load_motions("embedded", fps=5)  # neighbouring frames teach nothing new
    links = [
        syda_gym.fit(fewer.pair(a, b).without_actions([options.action]), seed=0)
        for a, b in zip(ROUTE[:-1], ROUTE[1:], strict=True)
    ]
    shown = motions.pair(ROUTE[0], ROUTE[-1]).only_actions([options.action]).clips()[0].source.frames
    frames = [shown]
    for link in links:
        frames.append(link(frames[-1]))
    tracks = [track(syda_gym.embodiment(name), rows) for name, rows in zip(ROUTE, frames, strict=True)]
    pictures = [Image.fromarray(draw(tracks, frame, labels=LABELS, size=SIZE)) for frame in range(len(shown))]
    with atomic_path(options.out) as temporary:
        pictures[0].save(
            temporary,
            save_all=True,
            append_images=pictures[1:],
            duration=round(1000 / FPS),
            loop=0,
            quality=72,
            method=6,
        )
    with atomic_path(options.out.with_suffix(".png")) as temporary:
        pictures[len(pictures) // 3].save(temporary, optimize=True)
    print(f"{options.out}: {len(pictures)} frames, {options.out.stat().st_size >> 10} kB")


if __name__ == "__main__":
    main()
