"""converted_apart: MJCF and xacro become URDF in a process of its own, because their libraries obey what a file says.

MuJoCo takes the memory that a model asks for and ends its process on some of them; xacro evaluates expressions and
macros that call themselves. Neither may take the caller along.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

from syda_gym.embodiments.reading.xacro import expanding
from syda_gym.errors import EmbodimentError, MissingExtraError

__all__ = ["converted_apart"]

_SECONDS = 60.0  # on the wall, for a busy machine
_PROCESSOR = 10  # s
_MEMORY = 4 << 30  # bytes of addresses, of which libraries take one or two without using them
_MOST = 32 << 20  # bytes of the URDF
_REFUSED = 4  # exit code
_LIBRARIES = {"mjcf": "mujoco", "xacro": "xacrodoc"}
_PACKAGE = Path(__file__).resolve().parents[3]


def converted_apart(kind: str, path: Path) -> bytes:
    """A URDF as bytes of XML.

    Args:
        kind: ``mjcf`` or ``xacro``.
        path: the file, with those that it includes.

    Raises:
        MissingExtraError: the library that reads it is not installed.
        EmbodimentError: it cannot be converted, or asks for too much.
    """
    library = _LIBRARIES[kind]
    if (library in sys.modules and sys.modules[library] is None) or importlib.util.find_spec(library) is None:
        if kind == "mjcf":
            raise MissingExtraError(f"{path.name} is MJCF, MuJoCo's format, not a URDF; reading MJCF", "mjcf")
        raise MissingExtraError(f"{path.name} is xacro, not yet a URDF ({expanding(path)}); reading xacro", "xacro")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.urdf"
        script = (
            f"import sys; sys.path.insert(0, {str(_PACKAGE)!r}); "
            "from syda_gym.embodiments.reading.apart import _main; sys.exit(_main(*sys.argv[1:]))"
        )
        command = [sys.executable, "-P", "-c", script, kind, str(path), str(out)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=_SECONDS, check=False)
        except subprocess.TimeoutExpired as error:
            raise EmbodimentError(f"{path} takes too long to convert; is it a robot?") from error
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        if done.returncode == _REFUSED:
            raise EmbodimentError(said[-1][:2000])
        if done.returncode != 0 or not out.is_file() or out.stat().st_size > _MOST:
            raise EmbodimentError(f"{path} asks for too much: the process that converted it did not survive it")
        return out.read_bytes()


def _main(kind: str, path: str, out: str) -> int:
    _limit()
    from syda_gym.embodiments.reading.mjcf import urdf_of_mjcf
    from syda_gym.embodiments.reading.xacro import urdf_of_xacro

    try:
        content = {"mjcf": urdf_of_mjcf, "xacro": urdf_of_xacro}[kind](Path(path))
        if len(content) > _MOST:
            raise EmbodimentError(f"{path} becomes a URDF of more than {_MOST >> 20} MB; that is no robot")
        Path(out).write_bytes(content)
    except (EmbodimentError, MemoryError, RecursionError) as error:
        text = " ".join(str(error).split()) or f"{path} asks for too much: {type(error).__name__}"
        print(text, file=sys.stderr)
        return _REFUSED
    return 0


def _limit() -> None:
    try:
        import resource
    except ImportError:  # there is none outside of Unix
        return
    resource.setrlimit(resource.RLIMIT_CPU, (_PROCESSOR, _PROCESSOR))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (2 * _MOST, 2 * _MOST))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
