"""What ``mkdocs`` runs while it builds the site.

The reference begins with what a user starts from; then it has one page a room and one section a module, found by
walking the package. Equations become MathML, so that no script is fetched to show them, and a page that would fetch
anything else from the network stops the build.
"""

from __future__ import annotations

import ast
import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

PACKAGE = Path(__file__).resolve().parents[1] / "syda_gym"
ROOMS = {
    "embodiments": "Bodies",
    "motions": "Motions",
    "routes": "Routes",
    "simulation": "Simulation",
    "mappings": "Mappings",
    "envs": "Environments",
    "agents": "Agents",
    "evaluation": "Evaluation",
    "teleoperation": "Teleoperation",
    "cli": "Command line",
    "errors": "Errors",
    "files": "Files",
}
START = {
    "From recordings to a mapping": (
        "mappings.fitting.fit.fit",
        "mappings.methods.unfitted.unfitted",
        "motions.loading.load_motions",
        "mappings.mapping.Mapping",
        "mappings.storage.save_mapping",
        "mappings.storage.load_mapping",
        "embodiments.embodiment.landmark_error",
    ),
    "Which way to go": (
        "routes.routing.best_route",
        "routes.routing.ranked_routes",
        "routes.metric.transferability",
        "routes.suggestion.suggest",
    ),
    "The environment: `gym.make`": (
        "envs.teleop.SydaTeleopEnv",
        "envs.vector.SydaTeleopVectorEnv",
    ),
    "Live": ("routes.piloting.choice.choose_mapping", "teleoperation.session.teleoperate"),
    "Bodies": ("embodiments.catalog.get", "teleoperation.setup.robot_setup.add_robot"),
}
"""What a user starts from, by what it is for."""

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_FETCHED = re.compile(
    r'<(?:script|img|iframe|source|video)[^>]*\ssrc="https?:[^"]*"|<link[^>]*stylesheet[^>]*"https?:[^"]*"'
)


def on_files(files: Files, config: Any) -> Files:
    """Adds the reference pages."""
    files.append(File.generated(config, "reference/start.md", content=start_page()))
    for room, title in ROOMS.items():
        files.append(File.generated(config, f"reference/{room}.md", content=reference_page(room, title)))
    return files


def start_page() -> str:
    """What most programs use, before the rooms one after the other."""
    parts = [
        "# Start here\n\nWhat most programs use. The names without a room are in `syda_gym` itself: `syda_gym.fit`, "
        "`syda_gym.load_motions` and so on. Every room has a page of its own behind this one.\n"
    ]
    for title, names in START.items():
        parts.append(f"\n## {title}\n")
        # The rooms' pages own the anchors; here the same text stands a second time, and nothing links to it.
        options = "      heading_level: 3\n      skip_local_inventory: true\n"
        parts += [f"\n::: syda_gym.{name}\n    options:\n{options}" for name in names]
    return "".join(parts)


def reference_page(room: str, title: str) -> str:
    """The page of one room: its purpose, then every module with public names."""
    folder = PACKAGE / room
    start = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    purpose = (ast.get_docstring(ast.parse(start.read_text())) or "").split("\n\n")[0]
    parts = [f"# {title}\n\n{purpose}\n"]
    for path in sorted(folder.rglob("*.py")) if folder.is_dir() else [start]:
        if path.name == "__init__.py" or not has_public_names(path):
            continue
        module = ".".join(("syda_gym", *path.relative_to(PACKAGE).with_suffix("").parts))
        parts.append(
            f"\n## `{module.removeprefix('syda_gym.')}`\n\n::: {module}\n    options:\n"
            "      show_root_heading: false\n      show_root_toc_entry: false\n"
        )
    return "".join(parts)


def has_public_names(path: Path) -> bool:
    """Whether a module defines a public class or function."""
    return any(
        isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_")
        for node in ast.parse(path.read_text()).body
    )


def on_page_content(content: str, **_: Any) -> str:
    """Replaces every equation that pymdownx.arithmatex has marked by MathML."""
    content = _INLINE.sub(lambda match: convert(html.unescape(match[1]).strip()), content)
    return _BLOCK.sub(lambda match: convert(html.unescape(match[1]).strip(), display="block"), content)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Stops the build at a page that would fetch something from the network when it is viewed."""
    if found := _FETCHED.search(output):
        raise PluginError(f"{page.file.src_uri} would fetch from the network: {found[0]}")
    return output
