"""Pictures are PNGs that show what was asked."""

from __future__ import annotations

import io

import numpy as np
import pytest

from syda_gym.routes.pictures import clouds_png, graph_png
from syda_gym.routes.routing import BodyGraph, best_route

FITTED = [("adult", "kid"), ("kid", "pepper"), ("adult", "stiff"), ("stiff", "pepper")]
FAST = {"definition": "general", "samples": 2**13, "repeats": 2}


def pixels(png: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def near(image: np.ndarray, color: tuple[int, int, int]) -> int:
    return int((np.abs(image - np.array(color)).max(axis=2) < 12).sum())


@pytest.mark.parametrize("definition", ["general", "paper"])
def test_clouds_show_regions_in_their_colours(definition: str) -> None:
    image = pixels(clouds_png("adult", "pepper", definition, samples=2**14, width=8.0))  # type: ignore[arg-type]
    assert image.shape[1] == 800
    for color in ((44, 127, 184), (230, 132, 42), (181, 181, 181)):
        assert near(image, color) > 200


def test_the_route_is_drawn_in_its_colour() -> None:
    graph = BodyGraph(fitted=FITTED, **FAST)
    route = best_route("adult", "pepper", FITTED, **FAST)
    red = (192, 41, 66)
    assert near(pixels(graph_png(graph, route)), red) > near(pixels(graph_png(graph)), red) + 500


def test_pictures_repeat_bit_by_bit() -> None:
    graph = BodyGraph(fitted=FITTED, **FAST)
    assert graph_png(graph) == graph_png(graph)


def test_on_dusk_there_is_no_ground_and_letters_can_be_read_on_white_and_on_black() -> None:
    from PIL import Image

    graph = BodyGraph(fitted=FITTED, **FAST)
    image = np.asarray(Image.open(io.BytesIO(graph_png(graph, ground="dusk"))).convert("RGBA"))
    assert (image[:5, :5, 3] == 0).all()
    ink = image[(image[..., 3] == 255) & (np.ptp(image[..., :3].astype(int), axis=2) < 30)][:, :3].mean(axis=1)
    letters = ink[(ink > 100) & (ink < 150)]
    assert len(letters) > 100  # of the legend: neither white nor black
    plain = np.asarray(Image.open(io.BytesIO(graph_png(graph))).convert("RGBA"))
    assert (plain[:5, :5] == 255).all()
