"""The graph of fitted pairs as inline SVG: humans on the left half of a circle, robots on the right."""

from __future__ import annotations

import math
from html import escape

from syda_gym.evaluation.report.model import RouteEdge, RouteGraph

__all__ = ["graph_svg"]

_WIDTH, _HEIGHT, _NODE = 720.0, 400.0, 34.0
_MOST_LABELS = 30


def graph_svg(graph: RouteGraph, *, narrow: bool = False) -> str:
    """Draws bodies as circles and fitted pairs as arrows, thicker where transferability is higher.

    The chosen route is drawn in the accent colour. With many edges their labels are left to the pointer.

    Args:
        graph: what to draw.
        narrow: half as wide, for a phone.
    """
    size = (360.0, 420.0) if narrow else (_WIDTH, _HEIGHT)
    name = "-narrow" if narrow else ""  # of the arrow heads: two drawings of one page must not share them
    places = _places(graph, *size)
    chosen = set(zip(graph.chosen[:-1], graph.chosen[1:], strict=True))
    node = _NODE if len(places) <= 10 else max(12.0, 300.0 / len(places))
    ordered = sorted(graph.edges, key=lambda edge: (edge.source, edge.target) in chosen)
    labels = len(ordered) <= _MOST_LABELS
    edges = [_edge(edge, places, node, (edge.source, edge.target) in chosen, labels, name) for edge in ordered]
    nodes = [_node(body, kind, *places[body], node, body in graph.chosen) for body, kind in graph.bodies.items()]
    parts = [*(arrow for arrow, _ in edges), *nodes, *(label for _, label in edges)]  # no label below a node
    heads = "".join(
        f'<marker id="{head}{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="{wide}" markerHeight="{wide}" '
        f'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 1L10 5L0 9z" fill="{colour}"/></marker>'
        for head, colour, wide in (("head", "var(--soft)", 10), ("head-chosen", "var(--accent)", 13))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]:g} {size[1]:g}" role="img" '
        f'aria-label="{escape(graph.title, quote=True)}" class="graph"><defs>{heads}</defs>{"".join(parts)}</svg>'
    )


def _places(graph: RouteGraph, width: float, height: float) -> dict[str, tuple[float, float]]:
    """Positions on an ellipse: humans over the left half, robots over the right one, in the order given."""
    humans = [name for name, kind in graph.bodies.items() if kind == "human"]
    robots = [name for name in graph.bodies if name not in humans]
    places: dict[str, tuple[float, float]] = {}
    for names, side in ((humans, -1.0), (robots, 1.0)):
        for index, name in enumerate(names):
            angle = math.pi * ((index + 0.5) / len(names) - 0.5)
            x = width / 2 + side * (width / 2 - (90 if width > 500 else 46)) * math.cos(angle)
            places[name] = (x, height / 2 + (height / 2 - 60) * math.sin(angle))
    return places


def _edge(
    edge: RouteEdge, places: dict[str, tuple[float, float]], node: float, chosen: bool, label: bool, suffix: str
) -> tuple[str, str]:
    """The arrow, and its label."""
    (x0, y0), (x1, y1) = places[edge.source], places[edge.target]
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    bend = 0.12 * length  # the two directions of a pair bend apart
    cx, cy = (x0 + x1) / 2 - uy * bend, (y0 + y1) / 2 + ux * bend
    start, end = _towards((x0, y0), (cx, cy), node), _towards((x1, y1), (cx, cy), node + 3)
    colour, head = ("var(--accent)", "head-chosen") if chosen else ("var(--soft)", "head")
    width = 1.0 + 4.0 * max(0.0, min(1.0, edge.transferability))
    error = "" if edge.error is None else f", error {100 * edge.error:.1f} cm"
    words = f"{edge.source} to {edge.target}: T = {edge.transferability:.3f}{error}"
    text = ""
    if label:
        lx, ly = _label_place(start, (cx, cy), end, list(places.values()), node + 14)
        text = (
            f'<text x="{lx:.1f}" y="{ly + 4:.1f}" text-anchor="middle" class="edge-label">'
            f"{edge.transferability:.2f}</text>"
        )
    arrow = (
        f'<g><path d="M{start[0]:.1f} {start[1]:.1f}Q{cx:.1f} {cy:.1f} {end[0]:.1f} {end[1]:.1f}" fill="none" '
        f'stroke="{colour}" stroke-width="{width:.2f}" opacity="{0.95 if chosen else 0.5}" '
        f'marker-end="url(#{head}{suffix})"><title>{escape(words)}</title></path></g>'
    )
    return arrow, text


def _label_place(
    start: tuple[float, float],
    control: tuple[float, float],
    end: tuple[float, float],
    nodes: list[tuple[float, float]],
    clear: float,
) -> tuple[float, float]:
    """A point on the curve, near its start, where arrows of other pairs do not cross, and beside all nodes."""
    found = []
    for t in (0.36, 0.5, 0.26, 0.62, 0.74, 0.16, 0.84):
        x, y = ((1 - t) ** 2 * start[axis] + 2 * t * (1 - t) * control[axis] + t**2 * end[axis] for axis in (0, 1))
        room = min(math.hypot(x - a, y - b) for a, b in nodes)
        if room >= clear:
            return x, y
        found.append((room, x, y))
    _, x, y = max(found)
    return x, y


def _towards(point: tuple[float, float], other: tuple[float, float], distance: float) -> tuple[float, float]:
    length = math.hypot(other[0] - point[0], other[1] - point[1]) or 1.0
    return (
        point[0] + distance * (other[0] - point[0]) / length,
        point[1] + distance * (other[1] - point[1]) / length,
    )


def _node(name: str, kind: str, x: float, y: float, radius: float, chosen: bool) -> str:
    style = "node chosen" if chosen else "node"
    inside = radius >= 26 and len(name) <= 9
    label = y + 4 if inside else y + radius + 15
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" class="{style} {escape(kind, quote=True)}">'
        f"<title>{escape(name)} ({escape(kind)})</title></circle>"
        f'<text x="{x:.1f}" y="{label:.1f}" text-anchor="middle">{escape(name)}</text>'
    )
