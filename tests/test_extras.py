"""Where an extra is missing, the error names it: every optional package is hidden in turn and its feature asked for."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
# Extra -> the package to hide, and code that needs it.
FEATURES = {
    "train": (
        "sb3_contrib",
        "from syda_gym.agents.residual.algorithms import _off_policy_class as use; use('tqc')",
    ),
    "export": (
        "onnx",
        "from syda_gym.agents.deployment import export; export.export_onnx(None, 'agent.onnx')",
    ),
    "c3d": (
        "ezc3d",
        "from pathlib import Path; Path('a.c3d').write_bytes(b'xP' * 500); import syda_gym; "
        "syda_gym.load_motions('a.c3d')",
    ),
    "ros": (
        "rosbags",
        "from pathlib import Path; Path('a.bag').write_bytes(b'#ROSBAG V2.0'); import syda_gym; "
        "syda_gym.load_motions('a.bag')",
    ),
    "mjcf": (
        "mujoco",
        "from pathlib import Path; Path('a.xml').write_text('<mujoco/>'); "
        "from syda_gym.embodiments.kinematics.urdf import read_urdf; read_urdf('a.xml')",
    ),
    "xacro": (
        "xacrodoc",
        "from pathlib import Path; space = 'http://www.ros.org/wiki/xacro'; "
        'text = f\'<robot xmlns:xacro="{space}" name="a"><xacro:macro name="m"/></robot>\'; '
        "Path('a.urdf.xacro').write_text(text); "
        "from syda_gym.embodiments.kinematics.urdf import read_urdf; read_urdf('a.urdf.xacro')",
    ),
    "live": (
        "websockets",
        "import syda_gym; from syda_gym.teleoperation.incoming.network import WebSocketSource;"
        "WebSocketSource(syda_gym.embodiment('adult')).start()",
    ),
    "camera": (
        "mediapipe",
        "from syda_gym.motions.film.pose_model import PoseModel; open('a.task', 'w').write('model');"
        "PoseModel('a.task')",
    ),
    "view": (
        "viser",
        "from syda_gym.simulation.page.plan import PagePlan; from syda_gym.simulation.page.process import PageProcess;"
        "PageProcess(PagePlan('title'), dict).open()",
    ),
    "naoqi": (
        "qi",
        "import syda_gym; from syda_gym.teleoperation.outgoing.naoqi import NaoqiSink;"
        "NaoqiSink(syda_gym.embodiment('pepper')).open()",
    ),
    "ik": (
        "mink",
        "import syda_gym; pair = syda_gym.load_motions('embedded', fps=1).pair('adult', 'pepper');"
        "syda_gym.fit(pair.only_actions(pair.action_names[:3]), method='mink')",
    ),
    "ray": (
        "ray",
        "from syda_gym.evaluation.pools import RayPool; import syda_gym;RayPool(None, print, ())",
    ),
    "data": (
        "pyarrow",
        "from syda_gym.evaluation.benchmark import results; results._arrow()",
    ),
}
WITHOUT_A_MODULE = {"robots"}  # found by its distribution's files, see below
INCLUDED = {"video", "docs", "dev"}  # the base has it, or no feature of the library needs it


def test_every_extra_is_tested() -> None:
    assert set(FEATURES) | WITHOUT_A_MODULE | INCLUDED == set(EXTRAS)


@pytest.mark.parametrize("extra", sorted(FEATURES))
def test_missing_extra_is_named(extra: str, tmp_path: Path) -> None:
    hidden, code = FEATURES[extra]
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT / 'tests')!r}); sys.modules[{hidden!r}] = None\n"
        f"from syda_gym.errors import MissingExtraError\n"
        f"try:\n    exec({code!r})\nexcept MissingExtraError as error:\n    print(error)"
    )
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert f"pip install 'syda-gym[{extra}]'" in result.stdout


def test_missing_robots_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib import metadata

    from syda_gym.embodiments.discovery import example_robots
    from syda_gym.errors import MissingExtraError

    def nothing(_: str) -> None:
        raise metadata.PackageNotFoundError("example-robot-data")

    monkeypatch.setattr(example_robots.metadata, "files", nothing)
    with pytest.raises(MissingExtraError, match=r"syda-gym\[robots\]"):
        example_robots.example_urdfs()
