"""What README and documentation say is true: code runs, commands parse, links lead somewhere, numbers have a source."""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*.md")])
NUMBER = re.compile(r"(?<![\w.-])-?\d*\.\d+(?![\w.]*\d)")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    line: int
    text: str
    run: bool


def blocks(path: Path) -> list[Block]:
    """All fenced blocks; a comment ``<!-- not run: reason -->`` above one says why it is only parsed."""
    found: list[Block] = []
    lines = path.read_text(encoding="utf-8").splitlines()
    start, language = -1, ""
    for number, line in enumerate(lines):
        fence = re.match(r"\s*```+\s*([\w-]*)", line)
        if not fence:
            continue
        if start < 0:
            start, language = number, fence[1]
            continue
        above = next((text for text in reversed(lines[:start]) if text.strip()), "")
        found.append(Block(language, start + 1, "\n".join(lines[start + 1 : number]), "<!-- not run:" not in above))
        start = -1
    assert start < 0, f"{name(path)}: a block that starts in line {start + 1} has no end"
    return found


def test_pages_were_found() -> None:
    assert ROOT / "README.md" in PAGES
    assert len(PAGES) > 5


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_python_parses(path: Path) -> None:
    for block in blocks(path):
        if block.language == "python":
            ast.parse(block.text, filename=f"{name(path)}:{block.line}")


@pytest.mark.parametrize(
    "path", [p for p in PAGES if any(b.language == "python" and b.run for b in blocks(p))], ids=name
)
def test_python_runs(path: Path, tmp_path: Path) -> None:
    """The blocks of one page run one after the other in one namespace, as a reader would type them."""
    program = []
    for block in blocks(path):
        if block.language == "python" and block.run:
            program.append("\n" * (block.line - sum(part.count("\n") + 1 for part in program)) + block.text)
    script = tmp_path / "page.py"
    script.write_text("\n".join(program))
    environment = {**os.environ, "MPLBACKEND": "Agg", "SYDA_GYM_HOME": str(tmp_path / "home"), "OMP_NUM_THREADS": "1"}
    result = subprocess.run(
        [sys.executable, script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert result.returncode == 0, f"lines are those of {name(path)}\n{result.stderr[-3000:]}"


def commands() -> list[tuple[str, str]]:
    """Every command line in a console block, with the page it stands on."""
    found = []
    for path in PAGES:
        for block in blocks(path):
            if block.language not in ("console", "bash", "sh", "shell", ""):
                continue
            for line in block.text.replace("\\\n", " ").splitlines():
                command = line.strip().removeprefix("$ ")
                # A block without a language may be a drawing; there only our own commands are meant.
                if command.startswith("syda-gym ") or (block.language and command and command[0] != "#"):
                    found.append((name(path), command))
    return found


def test_commands_were_found() -> None:
    assert any(command.startswith("syda-gym") for _, command in commands())


@pytest.mark.parametrize(("page", "command"), sorted(set(commands())))
def test_commands_exist(page: str, command: str) -> None:
    for part in re.split(r"\s(?:&&|\||;)\s", command):
        check_command(shlex.split(part, comments=True))


def check_command(words: list[str]) -> None:
    """Fails if the command is not one of ours with options that exist, or one that every reader has."""
    while words and re.fullmatch(r"\w+=.*", words[0]):  # VARIABLE=value before the command
        words = words[1:]
    tool = words[0].removeprefix(".venv/bin/") if words else ""
    if tool == "syda-gym":
        parse_with_cli(words[1:])
    elif tool == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert all("=" in word or word in targets for word in words[1:]), f"no such target: {words}"
    elif tool.startswith("python"):
        check_python(words[1:])
    elif tool == "pip":
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        for word in words[1:]:
            for group in re.findall(r"^(?:syda-gym|\.)\[(.*)\]$", word):
                assert set(group.split(",")) <= set(extras), f"no such extra: {word}"
    else:
        assert tool in {"git", "cd", "ray", "tensorboard", "export", "pip-audit", "source"}, f"unknown command {words}"


def check_python(words: list[str]) -> None:
    """A script that is named exists; a module that is run can be found."""
    if words[:1] == ["-m"]:
        assert words[1] in {"pip", "pytest", "venv", "build", "http.server", "rl_zoo3.train"}, words
    elif words and words[0].endswith(".py"):
        script = ROOT / words[0]
        assert script.is_file(), f"no script {words[0]}"
        source = script.read_text()
        for word in words[1:]:
            if word.startswith("--"):
                assert f'"{word.split("=")[0]}"' in source, f"{words[0]} has no option {word}"


def parse_with_cli(words: list[str]) -> None:
    """Parses a command line with the real command line interface, without running it."""
    import typer

    from syda_gym.cli.main import app

    command: Any = typer.main.get_command(app)
    # Placeholders such as FILE or DIR stand for paths that need not exist here.
    context = command.make_context("syda-gym", list(words), resilient_parsing=False) if words else None
    while context is not None and getattr(context.command, "commands", None):
        protected = getattr(context, "protected_args", None) or getattr(context, "_protected_args", [])
        rest = [*protected, *context.args]
        if not rest:
            return
        label, sub, tail = context.command.resolve_command(context, rest)
        context = sub.make_context(label, tail, parent=context)


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_lead_somewhere(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\(([^)\s]+)[^)]*\)", text) + re.findall(r'(?:src|href)="([^"]+)"', text)
    for target in targets:
        if re.match(r"[a-z]+:", target) or target.startswith("#"):
            continue
        file = target.split("#")[0]
        if "reference/" in file:  # written while the site is built, which checks these links itself
            continue
        assert (path.parent / file).exists(), f"dead link {target}"


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_style(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"(?<!\w)/(tmp|root|home|opt|mnt|Users)/", text), "a path of somebody's machine"
    assert not re.search(r"\b(TODO|FIXME|TBD|XXX|lorem ipsum)\b", text, re.IGNORECASE)
    assert text.startswith(("# ", "---", "<")), "a page starts with its title"
    assert text.endswith("\n")


def tables() -> list[tuple[Path, str, str]]:
    """Every table that holds decimals, with the comment above it that names its source."""
    found = []
    for path in PAGES:
        text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        for match in re.finditer(r"((?:^<!-- numbers:.*-->\n+)?)((?:^\|.*\|[ \t]*\n)+)", text, re.MULTILINE):
            if NUMBER.search(re.sub(r"`[^`]*`", "", match[2])):
                found.append((path, match[1].strip(), match[2]))
    return found


@pytest.mark.parametrize(
    ("path", "source", "table"), tables(), ids=lambda value: name(value) if isinstance(value, Path) else ""
)
def test_numbers_have_a_source(path: Path, source: str, table: str) -> None:
    """A table of figures names the results file they come from, and each figure is found there, rounded."""
    if "<!-- numbers: this page, written by scripts/" in path.read_text(encoding="utf-8"):
        return  # the whole page is what a script found
    named = re.fullmatch(r"<!-- numbers: (.+) -->", source)
    assert named, f"{name(path)}: say where these numbers come from:\n{table[:300]}"
    if not named[1].startswith("docs/"):
        return  # quoted from the paper, a standard or another package's documentation
    known = [value for file in named[1].split() for value in numbers_in(ROOT / file)]
    for text in NUMBER.findall(re.sub(r"`[^`]*`", "", table)):
        digits = len(text.split(".")[1])
        value, half = float(text), 0.5000001 * 10.0**-digits
        # A table may show a share in per cent or a length in millimetres or centimetres of the file's metres.
        scales = (1.0, 100.0, 1000.0)
        assert any(abs(abs(scale * entry) - abs(value)) <= half for entry in known for scale in scales), (
            f"{name(path)}: {text} is not in {named[1]}"
        )


def numbers_in(path: Path) -> list[float]:
    """Every number of a results file (JSON, CSV or text)."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        json.loads(text)
    return [float(found) for found in re.findall(r"-?\d+\.?\d*(?:[eE][-+]?\d+)?", text)]


def test_every_page_is_in_the_navigation() -> None:
    configuration = (ROOT / "mkdocs.yml").read_text()
    missing = [p for p in (ROOT / "docs").rglob("*.md") if f": {p.relative_to(ROOT / 'docs')}\n" not in configuration]
    assert not missing


def test_every_room_is_in_the_reference() -> None:
    configuration = (ROOT / "mkdocs.yml").read_text()
    rooms = [path.parent.name for path in (ROOT / "syda_gym").glob("*/__init__.py")]
    assert rooms
    assert not [room for room in rooms if f": reference/{room}.md\n" not in configuration]
