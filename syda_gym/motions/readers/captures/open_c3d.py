"""A script, run in a process of its own: the points of a C3D file as plain arrays (``open_c3d.py FILE OUT.npz``)."""

import sys

__all__: list[str] = []


def _limit() -> None:
    """At most 20 s of processor time and 4 GB of addresses."""
    try:
        import resource
    except ImportError:  # there is none outside of Unix
        return
    resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _main(path: str, out: str) -> int:
    _limit()
    try:
        import ezc3d
        import numpy as np
    except ImportError:
        return 3
    try:
        file = ezc3d.c3d(path)
        points = np.asarray(file["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
        group = file["parameters"]["POINT"]
        labels = [str(label) for label in group["LABELS"]["value"]][: points.shape[1]]
        for number in range(2, 6):  # more than 255 points: further lists
            labels += [str(label) for label in group.get(f"LABELS{number}", {"value": []})["value"]]
        residual = np.asarray(file["data"]["meta_points"]["residuals"])[0].T
        points = np.where((residual < 0)[:, :, None] | (points == 0).all(axis=2)[:, :, None], np.nan, points)
        rate = float(np.ravel(group["RATE"]["value"])[0])
        units = str((list(group.get("UNITS", {"value": [""]})["value"]) or [""])[0])
        if points.size > 24_000_000:
            raise ValueError(f"{points.size} numbers; at most 24000000 are read")
        names = np.array([label[:100] for label in labels[: points.shape[1]]] or [""], dtype="U100")
        np.savez(out, points=points, labels=names, rate=np.array(rate), units=np.array([units], dtype="U20"))
    except Exception as error:  # whatever the library raises is said in one line
        print(str(error).splitlines()[0] if str(error) else type(error).__name__, file=sys.stderr)
        return 4
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1], sys.argv[2]))
