"""Opening files with libraries that a damaged file can crash or hang: in a process of its own, with limits.

``ezc3d`` is C++ and ends its process on some damaged files; bags unpack what they hold. The child writes plain arrays
to a file, which is read as any stranger's file is.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import MissingExtraError, MotionError
from syda_gym.files import read_arrays

__all__ = ["arrays_from_child"]

_SECONDS = 60.0  # on the wall; the child ends itself after 4 to 20 s of processor time
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}  # threads reserve memory by the core
_MISSING, _REFUSED = 3, 4  # exit codes of ``in_child``


def arrays_from_child(script: str, path: Path, feature: str, extra: str, library: str) -> dict[str, NDArray[Any]]:
    """Runs one of the openers beside this file on a recording.

    Args:
        script: ``open_c3d`` or ``open_bag``.
        path: the recording.
        feature: for the message if the library is not installed.
        extra: of this package that installs it.
        library: that the opener needs.

    Returns:
        What the opener found, by name.

    Raises:
        MissingExtraError: the library is not installed.
        MotionError: the file cannot be opened.
    """
    if (library in sys.modules and sys.modules[library] is None) or importlib.util.find_spec(library) is None:
        raise MissingExtraError(feature, extra)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.npz"
        command = [
            sys.executable,
            "-P",
            str(Path(__file__).with_name("in_child.py")),
            script,
            str(path.resolve()),
            str(out),
        ]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_SECONDS, check=False, env={**os.environ, **_ONE_THREAD}
            )
        except subprocess.TimeoutExpired as error:
            raise MotionError(f"{path} takes too long to open; it is damaged or far too large") from error
        except OSError as error:
            raise MotionError(f"{path} cannot be opened: {error}") from error
        if done.returncode == _MISSING:
            raise MissingExtraError(feature, extra)
        if done.returncode != 0 or not out.is_file():
            reason = (
                done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] if done.returncode == _REFUSED else []
            )
            raise MotionError(
                f"{path} is damaged or too large: {reason[0][:300] if reason else 'the library that opens it failed'}"
            )
        return {
            name: np.asarray(value) for name, value in read_arrays(out, "what was found in it", MotionError).items()
        }
