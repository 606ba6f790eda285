"""Writes ``docs/dependencies.md``: every package that syda_gym or one of its extras brings, with its licence.

    python scripts/list_licences.py

Run it where all extras are installed; packages that are missing are listed as such and the exit code is 1.
"""

from __future__ import annotations

import importlib.metadata as metadata
import re
import sys
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "dependencies.md"
HEAD = """# Dependencies and licences

syda_gym itself is under the MIT licence. It ships two robot models (Pepper and NAO) that were written for it from
published kinematic and inertial numbers with primitive shapes, its own synthetic motions, and small weight files fitted
on them; no meshes and no recordings of other people. The recordings of the paper are published without a licence, so
they are not part of this project: it reads them from a folder that you name.

What `pip` installs with it, directly or through another package, as their own metadata states it. The column *for* says
which extra needs the package (`base` is always installed). `python scripts/list_licences.py` writes this page.

Known vulnerabilities of what is installed can be listed with `pip install pip-audit && pip-audit`; `SECURITY.md` in the
repository says what we guard against ourselves.

| package | licence | for |
|---|---|---|
"""
# What a package's metadata leaves out or states as its whole licence text; each read in the package's own licence file.
STATED_ELSEWHERE = {
    "cmeel-qhull": "Qhull",
    "embreex": "BSD-2-Clause",
    "ezc3d": "MIT",
    "vhacdx": "MIT",
    "xacro": "BSD",
}
SHORT = {
    "Apache Software License": "Apache-2.0",
    "Apache 2.0": "Apache-2.0",
    "Apache License, Version 2.0": "Apache-2.0",
    "BSD License": "BSD",
    "MIT License": "MIT",
    "The MIT License (MIT)": "MIT",
    "ISC License (ISCL)": "ISC",
    "zlib/libpng License": "Zlib",
    "Python Software Foundation License": "PSF",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0",
}


def main() -> int:
    """Walks the requirements of the installed project and writes the page."""
    needed, missing = collect("syda-gym")
    rows = []
    for name in sorted(needed, key=str.lower):
        rows.append(f"| {name} | {licence(name)} | {', '.join(sorted(needed[name], key=_base_first))} |")
    text = HEAD + "\n".join(rows) + "\n"
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {len(rows)} packages")
    if missing:
        print(f"not installed, so without a licence: {', '.join(sorted(missing))}", file=sys.stderr)
    return 1 if missing else 0


def collect(project: str) -> tuple[dict[str, set[str]], set[str]]:
    """All packages below ``project``: name to the extras of the project that bring it; and those not installed."""
    extras = metadata.metadata(project).get_all("Provides-Extra") or []
    needed: dict[str, set[str]] = {}
    missing: set[str] = set()
    for label in ("base", *extras):
        todo = [(project, frozenset({"" if label == "base" else label}))]
        seen = set()
        while todo:
            name, wanted = todo.pop()
            for requirement in _requirements(name):
                if not _applies(requirement, wanted):
                    continue
                if name == project and label != "base" and _applies(requirement, frozenset({""})):
                    continue
                key = (_normal(requirement.name), frozenset(requirement.extras) | {""})
                if key in seen:
                    continue
                seen.add(key)
                try:
                    proper = metadata.metadata(requirement.name)["Name"]
                except metadata.PackageNotFoundError:
                    missing.add(requirement.name)
                    continue
                if proper == project:
                    continue
                needed.setdefault(proper, set()).add(label)
                todo.append((requirement.name, key[1]))
    # What the base brings is there anyway: an extra is named only where it is the reason.
    return {name: {"base"} if "base" in labels else labels for name, labels in needed.items()}, missing


def licence(name: str) -> str:
    """The licence of an installed package as a short text."""
    if name in STATED_ELSEWHERE:
        return STATED_ELSEWHERE[name]
    data = metadata.metadata(name)
    if expression := data["License-Expression"]:
        return str(expression)
    classified = [c.split("::")[-1].strip() for c in data.get_all("Classifier") or [] if c.startswith("License ::")]
    stated = (data["License"] or "").strip()
    if stated and "\n" not in stated and len(stated) < 40 and stated != "UNKNOWN":
        return SHORT.get(stated, stated)
    if classified:
        return " or ".join(SHORT.get(entry, entry) for entry in classified)
    raise SystemExit(f"{name} states no licence in its metadata; read its licence file and add it to STATED_ELSEWHERE")


def _requirements(name: str) -> list[Requirement]:
    return [Requirement(text) for text in metadata.requires(name) or []]


def _applies(requirement: Requirement, extras: frozenset[str]) -> bool:
    marker = requirement.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in extras)


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _base_first(label: str) -> tuple[bool, str]:
    return label != "base", label


if __name__ == "__main__":
    sys.exit(main())
