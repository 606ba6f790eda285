"""The house keeps its order: layers, sizes, documentation, and nothing that can run code on load."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import LONGEST

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "syda_gym"
MODULES = sorted(PACKAGE.rglob("*.py"))


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def test_imports_run_one_way() -> None:
    tool = Path(sys.executable).with_name("lint-imports")
    result = subprocess.run([tool, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout[-3000:]


@pytest.mark.parametrize("path", MODULES, ids=name)
class TestModule:
    def test_says_what_it_is_for(self, path: Path) -> None:
        text = path.read_text()
        assert not text.strip() or ast.get_docstring(ast.parse(text)), "a module starts with its purpose"

    def test_says_what_it_offers(self, path: Path) -> None:
        # Public names beside ``__all__`` are shared within a room; what other rooms and users take is listed.
        tree = ast.parse(path.read_text())
        public = {n.name for n in tree.body if isinstance(n, ast.ClassDef | ast.FunctionDef) and n.name[0] != "_"}
        assert not public or exports(tree), "a module with public names has __all__"

    def test_loads_nothing_that_can_run_code(self, path: Path) -> None:
        text = path.read_text()
        found = re.findall(
            r"\b(?:pickle|joblib|dill|marshal)\b\.load|torch\.load\(|allow_pickle\s*=\s*True|yaml\.load\(", text
        )
        calls = {
            node.func.id
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        assert not found
        assert not calls & {"eval", "exec"}

    def test_leaves_nothing_open(self, path: Path) -> None:
        assert not re.search(r"\b(TODO|FIXME|XXX|NotImplementedError)\b", path.read_text())

    def test_asserts_nothing_that_a_user_can_break(self, path: Path) -> None:
        # Assertions vanish under python -O; only narrowing for the type checker ("is not None") is left to them.
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Assert):
                test = ast.unparse(node.test)
                assert " is not None" in test or test.startswith("isinstance("), f"line {node.lineno}: assert {test}"

    def test_keeps_global_random_state_alone(self, path: Path) -> None:
        pattern = r"np\.random\.(seed|rand|randn|uniform|normal|choice|shuffle)\(|torch\.manual_seed\(|^import random"
        assert not re.search(pattern, path.read_text(), re.MULTILINE)


def exports(tree: ast.Module) -> list[str] | None:
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
            return list(ast.literal_eval(node.value)) if not isinstance(node.value, ast.BinOp) else None
    return None


def test_type_hints_are_announced_to_users() -> None:
    assert (PACKAGE / "py.typed").is_file()


def test_every_room_has_tests() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    missing = {room for room in rooms if not list((ROOT / "tests" / room).glob("test_*.py"))}
    assert not missing


def test_recordings_are_not_in_the_project() -> None:
    folders = [ROOT / part for part in ("syda_gym", "tests", "docs", "examples", "scripts")]
    recorded = {".xlsx", ".xls", ".pkl", ".pt", ".pth"}
    found = [name(path) for folder in folders for path in folder.rglob("*") if path.suffix in recorded]
    assert not found


def test_files_that_are_run_first_exist() -> None:
    assert [name for name in LONGEST if not (ROOT / name).is_file()] == []


def test_every_script_is_listed_and_says_what_it_is_for() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text()
    for path in (ROOT / "scripts").glob("*.py"):
        assert f"`{path.stem}`" in page, f"CONTRIBUTING.md does not list {path.name}"
        assert ast.get_docstring(ast.parse(path.read_text()))


def test_no_file_grows_beyond_500_lines() -> None:
    folders = [ROOT / part for part in ("syda_gym", "scripts", "tests", "examples")]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".js", ".css")]
    assert not {name(path): count for path in files if (count := len(path.read_text().splitlines())) >= 500}


def test_no_folder_grows_beyond_what_one_sees_at_a_glance() -> None:
    folders = {path.parent for path in MODULES}
    counts = {name(folder): len(list(folder.glob("*.py"))) for folder in folders}
    assert not {folder: count for folder, count in counts.items() if count > 14}


def test_every_room_says_in_one_sentence_what_lives_there() -> None:
    silent = [name(path) for path in PACKAGE.rglob("__init__.py") if not ast.get_docstring(ast.parse(path.read_text()))]
    assert not silent


def test_tests_mirror_the_rooms() -> None:
    rooms = {path.parent.relative_to(PACKAGE) for path in MODULES}
    tested = {path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py")}
    assert not {str(room) for room in tested if room not in rooms and str(room) != "assets"}
