"""What a user installs: the wheel, the source distribution, what importing costs, and what extras say when absent."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "syda_gym"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LAZY = ("torch", "pybullet", "stable_baselines3", "pinocchio", "matplotlib", "yourdfpy", "networkx", "scipy", "pandas")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the source distribution."""
    out = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)]
    result = subprocess.run([*build, "--wheel", "--sdist"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout[-2000:] + result.stderr[-2000:]
    return out


@pytest.fixture(scope="module")
def distributions(built: Path) -> dict[str, set[str]]:
    """File names inside the wheel and the source distribution."""
    wheel, sdist = next(built.glob("*.whl")), next(built.glob("*.tar.gz"))
    with tarfile.open(sdist) as archive:
        inside = {member.name.split("/", 1)[1] for member in archive.getmembers() if member.isfile()}
    return {"wheel": set(zipfile.ZipFile(wheel).namelist()), "sdist": inside}


def package_files() -> set[str]:
    return {
        str(path.relative_to(ROOT))
        for path in PACKAGE.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and not path.name.startswith(".")
    }


def test_wheel_holds_the_package_with_every_asset_and_nothing_else(distributions: dict[str, set[str]]) -> None:
    inside = {name for name in distributions["wheel"] if ".dist-info/" not in name}
    assert inside == package_files()
    assert any(name.endswith("pepper.urdf") for name in inside)
    assert any(name.endswith("embedded.npz") for name in inside)


def test_source_distribution_can_be_tested_and_documented(distributions: dict[str, set[str]]) -> None:
    inside = distributions["sdist"]
    assert package_files() <= inside
    for needed in (
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        "Makefile",
        "mkdocs.yml",
        "tests/conftest.py",
    ):
        assert needed in inside
    allowed = {"syda_gym", "scripts", "tests", "docs", "examples"}
    strangers = {name for name in inside if "/" in name and name.split("/")[0] not in allowed}
    assert not strangers
    assert not {name for name in inside if name.endswith((".xlsx", ".pyc", ".mp4"))}


def test_wheel_works_outside_the_checkout(built: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        wheel.extractall(tmp_path / "installed")
    # Every module, motions, a robot, agents; scripts/check_wheel.py steps the environment, whose kernels compile anew.
    code = (
        "import importlib, pkgutil, gymnasium, syda_gym; from syda_gym.embodiments import catalog;"
        "names = [m.name for m in pkgutil.walk_packages(syda_gym.__path__, 'syda_gym.') if '__main__' not in m.name];"
        "[importlib.import_module(name) for name in names]; from syda_gym.agents.work import shipped_agents;"
        "from syda_gym.agents.deployment.numpy_runner import bundle_path;"
        "print(syda_gym.__file__, len(names), gymnasium.spec('SydaTeleop-v0').id, catalog.get('pepper').name,"
        "len(syda_gym.load_motions('embedded').takes),"
        "all(bundle_path(name).with_suffix('.safetensors').is_file() for name in shipped_agents()))"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed"), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr[-2000:]
    file, modules, *found = result.stdout.split()[-6:]
    assert file.startswith(str(tmp_path / "installed"))
    assert int(modules) > 300
    assert found[:2] == ["SydaTeleop-v0", "pepper"]
    assert int(found[2]) > 50
    assert found[3] == "True"


def run(code: str) -> subprocess.CompletedProcess[str]:
    # From another folder, so that the installed package is what is imported.
    return subprocess.run([sys.executable, "-c", code], cwd="/", capture_output=True, text=True, check=False)


def test_import_loads_nothing_heavy() -> None:
    result = run(f"import sys, syda_gym; print([name for name in {LAZY!r} if name in sys.modules])")
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "[]"


def test_import_takes_less_than_a_second() -> None:
    # Processor time, because other work may share the machine.
    result = run("import time; start = time.process_time(); import syda_gym; print(time.process_time() - start)")
    assert result.returncode == 0, result.stderr
    assert float(result.stdout) < 1.0


def test_every_public_name_is_there_and_a_wrong_one_is_refused() -> None:
    import syda_gym

    for name in syda_gym.__all__:
        assert getattr(syda_gym, name) is not None
    assert set(syda_gym.__all__) <= set(dir(syda_gym))
    with pytest.raises(AttributeError, match="transferabilty"):
        syda_gym.transferabilty  # noqa: B018


def test_version_is_the_distribution_s() -> None:
    import importlib.metadata

    import syda_gym

    assert syda_gym.__version__ == PROJECT["project"]["version"] == importlib.metadata.version("syda-gym")


def extras_named_in_errors() -> list[tuple[str, str]]:
    """Every extra that a ``MissingExtraError("feature", "extra")`` of the package tells users to install."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "MissingExtraError":
                arguments = [*node.args, *(keyword.value for keyword in node.keywords)]
                if len(arguments) == 2 and isinstance(arguments[1], ast.Constant):
                    found.append((str(path.relative_to(ROOT)), str(arguments[1].value)))
    return found


def test_errors_name_extras_that_exist() -> None:
    named = extras_named_in_errors()
    assert named
    unknown = [entry for entry in named if entry[1] not in PROJECT["project"]["optional-dependencies"]]
    assert not unknown


def test_licences_of_all_direct_dependencies_are_listed() -> None:
    from packaging.requirements import Requirement

    page = (ROOT / "docs" / "dependencies.md").read_text().lower().replace("_", "-")
    extras = PROJECT["project"]["optional-dependencies"].values()
    texts = [*PROJECT["project"]["dependencies"], *(text for extra in extras for text in extra)]
    missing = [
        name for text in texts if f"| {(name := Requirement(text).name.lower().replace('_', '-'))} |" not in page
    ]
    assert not missing, "run python scripts/list_licences.py where all extras are installed"
