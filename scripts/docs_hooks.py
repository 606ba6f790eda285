"""What ``mkdocs`` runs while it builds the site.

The reference has one page a room and one section a module, found by walking the package. Equations become MathML, so
that no script is fetched to show them, and a page that would fetch anything else from the network stops the build.
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
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_FETCHED = re.compile(
    r'<(?:script|img|iframe|source|video)[^>]*\ssrc="https?:[^"]*"|<link[^>]*stylesheet[^>]*"https?:[^"]*"'
)


def on_files(files: Files, config: Any) -> Files:
    """Adds the reference pages."""
    for room, title in ROOMS.items():
        files.append(File.generated(config, f"reference/{room}.md", content=reference_page(room, title)))
    return files


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
