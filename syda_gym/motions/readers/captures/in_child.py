"""A script, run in a process of its own: opens a recording with limits (``in_child.py open_c3d FILE OUT.npz``).

It stands alone: what it runs is a file beside it with a function ``arrays(path)``, and the exit code says how it went.
"""

import importlib.util
import math
import sys
import time
from pathlib import Path

__all__: list[str] = []

_MISSING, _REFUSED = 3, 4  # ``child`` knows these codes


_BYTES_PER_SECOND = 4e5  # of a bag that is compressed tenfold
_BYTES_PER_BYTE = 160  # of the same


def _limit(path: Path) -> None:
    """Processor time from now on and addresses by what a sound file needs: 4 s and 1 GB, at most 20 s and 4 GB."""
    try:
        import resource
    except ImportError:  # there is none outside of Unix
        return
    parts = path.rglob("*") if path.is_dir() else [path]
    size = sum(part.stat().st_size for part in parts if part.is_file())
    seconds = math.ceil(time.process_time()) + min(4 + round(size / _BYTES_PER_SECOND), 20)
    memory = min((1 << 30) + _BYTES_PER_BYTE * size, 4 << 30)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _main(script: str, path: str, out: str) -> int:
    spec = importlib.util.spec_from_file_location(script, Path(__file__).with_name(f"{script}.py"))
    if spec is None or spec.loader is None:
        return _REFUSED
    opener = importlib.util.module_from_spec(spec)
    try:
        import numpy as np

        spec.loader.exec_module(opener)  # imports the library that opens
    except ImportError:
        return _MISSING
    _limit(Path(path))  # importing a library on a slow machine takes long, whatever the file
    try:
        np.savez(out, **opener.arrays(Path(path)))
    except Exception as error:  # whatever the library raises is said in one line
        print(str(error).splitlines()[0] if str(error) else type(error).__name__, file=sys.stderr)
        return _REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:4]))
