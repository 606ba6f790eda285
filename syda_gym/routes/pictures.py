"""Pictures: clouds of manipulability, regions that suffice or lack, and the graph of bodies with its chosen route.

After Fig. 3, 4 and 7 of the paper. Every function returns the bytes of a PNG.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.look import plot_theme
from syda_gym.routes import general, paper
from syda_gym.routes.general import Sampling
from syda_gym.routes.metric import Definition, Transferability, pair_arms, transferability
from syda_gym.routes.route import Route
from syda_gym.routes.routing import Body, BodyGraph
from syda_gym.routes.workspace.sampling import Workspace, generic_rank
from syda_gym.routes.workspace.store import MEMORY, WorkspaceStore

__all__ = ["clouds_png", "graph_png"]

_SUFFICIENT, _LACKING, _OUT_OF_REACH = "#2c7fb8", "#e6842a", "#b5b5b5"
_ROUTE, _TIE, _FITTED, _OTHER = "#c02942", "#e08a9b", "#64768a", "#c4ccd4"
_HUMAN, _ROBOT, _ON_NODES = "#fbe3c0", "#cfe3f2", "#1c222b"
_MOST_LABELS = 24

# From the midline, a little from the front and above: forward points to the right, the cut faces the eye.
_VIEW = {"elev": 16.0, "azim": -68.0}


def clouds_png(
    source: Body,
    target: Body,
    definition: Definition = "general",
    *,
    samples: int = Sampling.samples,
    seed: int = 0,
    store: WorkspaceStore = MEMORY,
    width: float = 13.0,
    ground: str = "day",
) -> bytes:
    """Draws where both bodies' arms move how easily, and where the target suffices, lacks or cannot reach.

    The upper row shows the cells on the far side of a cut through the shoulder of a left arm, the lower row the cut
    itself: the sagittal plane, or the frontal plane of a right arm for ``paper``, whose x axis points to the right.
    M is the manipulability over the arm's length cubed.

    Args:
        source: the body A that leads.
        target: the body B that follows.
        definition: ``general`` or ``paper``.
        samples: Sobol samples per arm (``general``).
        seed: their seed.
        store: where sampled workspaces are kept.
        width: width of the picture in inches, at 100 dots per inch; below 6 the lower row alone, for a phone.
        ground: ``"day"`` for light pages, ``"night"`` for dark ones, ``"dusk"`` for both (see ``look.plot_theme``).

    Returns:
        PNG bytes.

    Raises:
        EmbodimentError: an unusable body.
    """
    import matplotlib

    a, b = _workspaces(source, target, definition, samples, seed, store)
    result = transferability(source, target, definition, store=store)
    with matplotlib.rc_context(plot_theme(ground)):
        return (
            _draw_narrow(a, b, result, definition, width)
            if width < 6.0
            else _draw_wide(a, b, result, definition, width)
        )


def _draw_wide(a: Workspace, b: Workspace, result: Transferability, definition: Definition, width: float) -> bytes:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 0.66 * width), dpi=100)
    grid = figure.add_gridspec(
        2,
        5,
        width_ratios=(1.0, 1.0, 0.04, 0.12, 1.0),
        left=0.05,
        right=0.965,
        top=0.9,
        bottom=0.07,
        wspace=0.3,
        hspace=0.1,
    )
    top = max(float(a.manipulability.max()), float(b.manipulability.max()))
    for column, (workspace, name) in enumerate(((a, result.source), (b, result.target))):
        cloud = figure.add_subplot(grid[0, column], projection="3d")
        half = _far_half(workspace.present, definition)
        values = workspace.manipulability[half]
        _draw_cloud(cloud, workspace.centres(half), definition, c=values, cmap="viridis", vmin=0.0, vmax=top)
        _dress_cloud(cloud, f"{name}: manipulability", definition)
        flat = figure.add_subplot(grid[1, column])
        shade = _draw_slice(flat, _slice(workspace.manipulability, workspace.present), workspace, top)
        _dress_slice(flat, f"{name}: slice through the shoulder", definition)
    bar = figure.colorbar(shade, cax=figure.add_subplot(grid[1, 2]))
    bar.ax.tick_params(labelsize=7)
    bar.ax.set_title("M", fontsize=9)
    regions = _regions(a, b)
    cloud = figure.add_subplot(grid[0, 4], projection="3d")
    halves = [(color, a.centres(_far_half(mask, definition))) for _, color, mask in regions]
    # One scatter for all regions: matplotlib sorts by depth within a scatter only.
    colors = [color for color, points in halves for _ in points]
    _draw_cloud(cloud, np.concatenate([points for _, points in halves]), definition, c=colors)
    _dress_cloud(cloud, f"where {result.target} can stand in for {result.source}", definition)
    flat = figure.add_subplot(grid[1, 4])
    _draw_regions(flat, regions, a)
    _dress_slice(flat, f"the same slice; shares of {result.source}'s workspace", definition)
    figure.suptitle(_summary(result), fontsize=11.5, y=0.97)
    return _png(figure)


def _draw_narrow(a: Workspace, b: Workspace, result: Transferability, definition: Definition, width: float) -> bytes:
    """The slices alone, one below the other where they need the room."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 1.85 * width), dpi=200, layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(0.55, 1.0))
    top = max(float(a.manipulability.max()), float(b.manipulability.max()))
    for column, (workspace, name) in enumerate(((a, result.source), (b, result.target))):
        axis = figure.add_subplot(grid[0, column])
        shade = _draw_slice(axis, _slice(workspace.manipulability, workspace.present), workspace, top)
        _dress_slice(axis, f"{name}: M", definition)
        axis.set_xlabel("")
        if column:
            axis.set_ylabel("")
    figure.colorbar(shade, ax=figure.axes, orientation="horizontal", shrink=0.8, label="manipulability M")
    axis = figure.add_subplot(grid[1, :])
    _draw_regions(axis, _regions(a, b), a)
    _dress_slice(axis, f"where {result.target} can stand in for {result.source}", definition)
    figure.suptitle(f"T = {result.T:.3f}, capability {result.C:.3f}", fontsize=10)
    return _png(figure)


def graph_png(
    graph: BodyGraph,
    route: Route | None = None,
    *,
    ties: Sequence[Route] = (),
    width: float = 10.0,
    height: float = 6.5,
    ground: str = "day",
) -> bytes:
    """Draws bodies, fitted pairs with T both ways, and the chosen route (after Fig. 4 and 7 of the paper).

    Args:
        graph: bodies and fitted pairs.
        route: the chosen route, drawn in red; its ties are drawn lighter.
        ties: further routes to draw lighter.
        width: inches, at 100 dots per inch.
        height: inches.
        ground: as in ``clouds_png``.

    Returns:
        PNG bytes.
    """
    import matplotlib

    with matplotlib.rc_context(plot_theme(ground)):
        return _draw_graph(graph, route, ties, (width, height))


def _draw_graph(graph: BodyGraph, route: Route | None, ties: Sequence[Route], size: tuple[float, float]) -> bytes:
    import networkx
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=100)
    axis = figure.add_subplot()
    net = graph.graph
    places = _places(graph, route)
    chosen = _edges(route)
    light = {edge for other in (*ties, *(route.ties if route else ())) for edge in _edges(other)} - chosen
    for edges, color, wide in (
        ([e for e in net.edges if e not in chosen | light], _FITTED if len(net.edges) <= _MOST_LABELS else _OTHER, 1.4),
        (sorted(light), _TIE, 2.2),
        (sorted(chosen), _ROUTE, 3.2),
    ):
        networkx.draw_networkx_edges(
            net, places, edgelist=edges, edge_color=color, width=wide, ax=axis, node_size=2600, arrowsize=16,
            connectionstyle="arc3,rad=0.14",
        )  # fmt: skip
    kinds = [_HUMAN if graph.bodies[name].kind == "human" else _ROBOT for name in net.nodes]
    rims = [_ROUTE if route and name in route.bodies else _FITTED for name in net.nodes]
    networkx.draw_networkx_nodes(
        net, places, node_color=kinds, edgecolors=rims, linewidths=1.6, node_size=2600, ax=axis
    )
    labels = {name: "\n".join(textwrap.wrap(name.replace("_", " "), 11)) for name in net.nodes}
    networkx.draw_networkx_labels(net, places, labels, font_size=8.5, font_color=_ON_NODES, ax=axis)
    labelled = list(net.edges) if len(net.edges) <= _MOST_LABELS else sorted(chosen | light)
    networkx.draw_networkx_edge_labels(
        net, places, {edge: f"{graph.link(*edge).T:.3f}" for edge in labelled}, font_size=8.5, ax=axis,
        label_pos=0.4, rotate=False, connectionstyle="arc3,rad=0.14",
        font_color=_ON_NODES,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip
    if route is not None:
        worth = f"T = {route.T:.3f} ± {route.tolerance:.3f}"
        if route.error is not None and route.standard_error is not None:
            worth = f"expected error {1000 * route.error:.0f} ± {1000 * route.standard_error:.0f} mm"
        text = f"{' → '.join(route.bodies)}    {worth}"
        if route.ties:
            text += "\nties with " + "; ".join(" → ".join(other.bodies) for other in route.ties[:3])
        axis.set_title(text, fontsize=11)
    axis.set_axis_off()
    axis.margins(0.16)
    _legend_of_graph(axis, graph, bool(chosen), bool(light))
    figure.tight_layout()
    return _png(figure)


def _workspaces(
    source: Body, target: Body, definition: Definition, samples: int, seed: int, store: WorkspaceStore
) -> tuple[Workspace, Workspace]:
    a, b = catalog.resolve(source), catalog.resolve(target)
    if definition == "paper":
        return paper.paper_workspace(paper.paper_arm(a), store), paper.paper_workspace(paper.paper_arm(b), store)
    pair = pair_arms(a, b)[0][0]
    rank = min(generic_rank(pair.source), generic_rank(pair.target))
    sampling = Sampling(samples=samples, seed=seed)
    return (
        general.general_workspace(pair.source, sampling, 0, rank, store),
        general.general_workspace(pair.target, sampling, 1, rank, store),
    )


def _regions(a: Workspace, b: Workspace) -> list[tuple[str, str, NDArray[np.bool_]]]:
    enough = b.manipulability >= a.manipulability
    return [
        ("sufficient", _SUFFICIENT, a.present & b.present & enough),
        ("lacking", _LACKING, a.present & b.present & ~enough),
        ("out of reach", _OUT_OF_REACH, a.present & ~b.present),
    ]


def _slice(values: NDArray[Any], mask: NDArray[np.bool_]) -> FloatArray:
    """The plane of cells through the shoulder that runs forward and up, ``(size, size)``; NaN where empty."""
    middle = values.shape[1] // 2
    return np.where(mask[:, middle], values[:, middle], np.nan)


def _far_half(mask: NDArray[np.bool_], definition: Definition) -> NDArray[np.bool_]:
    """Cells from the cut through the shoulder on, as seen by the eye: outward of the shoulder, or in front of it."""
    half, middle = mask.copy(), mask.shape[1] // 2
    if definition == "general":
        half[:, middle + 1 :] = False
    else:
        half[:, :middle] = False
    return half


def _draw_cloud(axis: Any, points: FloatArray, definition: Definition, **colors: Any) -> None:
    if definition == "general":  # workspaces are those of a right arm; a left one lets forward point to the right
        points = points * np.array([1.0, -1.0, 1.0])
    if len(points):
        axis.scatter(*points.T, s=26, marker="s", linewidths=0, depthshade=False, **colors)


def _draw_slice(axis: Any, plane: FloatArray, workspace: Workspace, top: float) -> Any:
    edge = ((plane.shape[0] - 1) / 2 + 0.5) * workspace.cell
    return axis.imshow(
        plane.T, origin="lower", extent=(-edge, edge, -edge, edge), cmap="viridis", vmin=0.0, vmax=top,
        interpolation="nearest",
    )  # fmt: skip


def _draw_regions(axis: Any, regions: list[tuple[str, str, NDArray[np.bool_]]], workspace: Workspace) -> None:
    import matplotlib
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    size = workspace.counts.shape[0]
    plane = np.full((size, size), np.nan)
    middle = size // 2
    for index, (_, _, mask) in enumerate(regions):
        plane[mask[:, middle]] = index
    edge = 0.5 * size * workspace.cell
    axis.imshow(
        plane.T, origin="lower", extent=(-edge, edge, -edge, edge), interpolation="nearest", vmin=0, vmax=2,
        cmap=ListedColormap([color for _, color, _ in regions]),
    )  # fmt: skip
    total = max(1, sum(int(mask.sum()) for _, _, mask in regions))
    handles = [Patch(color=color, label=f"{label} {mask.sum() / total:.0%}") for label, color, mask in regions]
    # It lies on the regions: without a ground of the page it brings its own.
    own = {"facecolor": "#eef1f5", "labelcolor": _ON_NODES} if matplotlib.rcParams["legend.facecolor"] == "none" else {}
    axis.legend(handles=handles, loc="lower left", fontsize=7.5, framealpha=0.92, **own)


def _dress_cloud(axis: Any, title: str, definition: Definition) -> None:
    axis.scatter([0], [0], [0], color=_ink(), s=30)
    labels = ("forward", "left", "up") if definition == "general" else ("right", "forward", "up")
    for set_label, label in zip((axis.set_xlabel, axis.set_ylabel, axis.set_zlabel), labels, strict=True):
        set_label(label, fontsize=8, labelpad=-12)
    for limits in (axis.set_xlim, axis.set_ylim, axis.set_zlim):
        limits(-1.05, 1.05)
    for ticks in (axis.xaxis, axis.yaxis, axis.zaxis):
        ticks.set_ticks([-1.0, -0.5, 0.0, 0.5, 1.0], labels=[])
    axis.set_box_aspect((1, 1, 1), zoom=1.25)
    axis.view_init(**_VIEW)
    axis.set_title(title, fontsize=10, pad=2)


def _dress_slice(axis: Any, title: str, definition: Definition) -> None:
    axis.plot(0, 0, "o", color=_ink(), markersize=5)
    axis.set_xlim(-1.1, 1.1)
    axis.set_ylim(-1.1, 1.1)
    axis.set_xlabel(f"{'forward' if definition == 'general' else 'right'} [arm lengths]", fontsize=8)
    axis.set_ylabel("up [arm lengths]", fontsize=8)
    axis.tick_params(labelsize=7)
    axis.set_title(title, fontsize=10)


def _ink() -> Any:
    """What stands out from the page."""
    import matplotlib

    return matplotlib.rcParams["text.color"]


def _summary(result: Transferability) -> str:
    noise = f" ± {result.tolerance:.3f}" if result.tolerance else ""
    return (
        f"{result.source} → {result.target} ({result.definition}):   S {result.S:.3f}   1-D {1 - result.D:.3f}   "
        f"C {result.C:.3f}   L {result.L:.3f}   alpha {result.alpha:.2f}   T {result.T:.3f}{noise}   "
        f"coverage {result.coverage:.2f}"
    )


def _edges(route: Route | None) -> set[tuple[str, str]]:
    return set(zip(route.bodies[:-1], route.bodies[1:], strict=True)) if route else set()


def _places(graph: BodyGraph, route: Route | None) -> dict[str, tuple[float, float]]:
    """Humans on the left half of a circle, robots on the right; the route runs from left to right if there is one."""
    names = sorted(graph.bodies, key=lambda name: (graph.bodies[name].kind != "human", name))
    if route is not None:
        others = [name for name in names if name not in route.bodies]
        places = {name: (2.0 * i / max(1, route.hops) - 1.0, 0.0) for i, name in enumerate(route.bodies)}
        for i, name in enumerate(others):
            row, x = (1.0 if i % 2 == 0 else -1.0), 2.0 * (i // 2 + 0.5) / max(1, (len(others) + 1) // 2) - 1.0
            places[name] = (0.8 * x, 0.9 * row)
        return places
    angles = np.pi / 2 + np.pi / len(names) + 2.0 * np.pi * np.arange(len(names)) / len(names)
    return {name: (float(np.cos(t)), float(np.sin(t))) for name, t in zip(names, angles, strict=True)}


def _legend_of_graph(axis: Any, graph: BodyGraph, chosen: bool, tied: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    kinds = {body.kind for body in graph.bodies.values()}
    handles: list[Any] = [
        Patch(facecolor=color, edgecolor=_FITTED, label=kind)
        for kind, color in (("human", _HUMAN), ("robot", _ROBOT))
        if kind in kinds
    ]
    handles.append(Line2D([], [], color=_FITTED, label="fitted pair, T each way"))
    handles += [Line2D([], [], color=_ROUTE, lw=3, label="chosen route")] if chosen else []
    handles += [Line2D([], [], color=_TIE, lw=2, label="tied route")] if tied else []
    axis.legend(handles=handles, loc="lower center", ncol=5, fontsize=8, frameon=False, bbox_to_anchor=(0.5, -0.04))


def _png(figure: Any) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
