"""own: this user's mappings on disk: fitted, judged, saved, and fitted again with more recordings."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from syda_gym.errors import MotionError, OptionError, StorageError
from syda_gym.files import read_json, write_json
from syda_gym.mappings.fitting.learning import Judged, fit_and_judge
from syda_gym.mappings.models.autoencoder_training import Progress
from syda_gym.mappings.storage import save_mapping
from syda_gym.motions.clip import Motions
from syda_gym.motions.loading import FORMATS, load_motions, resampled
from syda_gym.motions.recordings import joined, recorded, recordings_folder
from syda_gym.routes.piloting.links import FIT_FPS, own_mappings_folder

__all__ = ["OwnFit", "fit_own"]

_FORMAT = "syda-gym fit 1"


@dataclass(frozen=True, eq=False)
class OwnFit:
    """What ``fit_own`` did.

    Attributes:
        judged: the mapping and what its recordings gained.
        path: where it lies.
        sources: the data sets that it was fitted on.
        notices: what was left out.
    """

    judged: Judged
    path: Path
    sources: tuple[str, ...]
    notices: tuple[str, ...]


def fit_own(
    sources: Sequence[str | os.PathLike[str]] = (),
    *,
    ends: tuple[str, str] | None = None,
    add: bool = False,
    out: str | os.PathLike[str] | None = None,
    method: str = "syda",
    preset: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> OwnFit:
    """Fits a mapping to data sets, judges it and saves it where every command finds it.

    Args:
        sources: data sets, see ``load_motions``; by default all that ``syda-gym record`` kept.
        ends: from which body to which; may be left out where the data hold one pair.
        add: fit on the data sets of the stored mapping as well.
        out: where to save, without an ending; by default ``own_mappings_folder()/SOURCE-TARGET``.
        method: as for ``fit``.
        preset: as for ``fit``.
        seed: as for ``fit``.
        progress: told the finished fraction.
        **options: as for ``fit``.

    Returns:
        What was done.

    Raises:
        MotionError: no data, data sets that cannot be joined, or no such pair in them.
        OptionError: several pairs and no ``ends``; ``add`` without data sets to add.
        StorageError: ``add`` to a mapping that is not there, or whose data sets are gone.
        MappingError: frames from which nothing can be learnt.
        EmbodimentError: bodies without a common arm.
    """
    notices: tuple[str, ...] = ()
    names = list(dict.fromkeys(_located(os.fspath(source)) for source in sources))
    if add and not names:
        raise OptionError("nothing to add: name the data sets, for example `syda-gym fit --add RECORDING`")
    if not names:
        found = recorded()
        if found.motions is None:
            left = "".join(f"\n- {notice}" for notice in found.notices)
            raise MotionError(
                f"{recordings_folder()} holds no recordings to fit on: record with `syda-gym record`, or name data sets"
                + left
            )
        names, notices = [_located(str(folder)) for folder in found.folders], found.notices
    parts = [load_motions(name) for name in names]
    source, target = _ends(parts, ends)
    base = _base(out, source, target)
    if add:
        earlier = [name for name in _sources_of(base) if name not in names]
        parts = [*(_load_again(name, base) for name in earlier), *parts]
        names = [*earlier, *names]
    used = [(part, name) for part, name in zip(parts, names, strict=True) if (source, target) in _both_ways(part)]
    parts, names = [part for part, _ in used], [name for _, name in used]
    motions = joined(parts, " and ".join(part.name for part in parts))
    pair = motions.pair(source, target)
    if pair.fps > FIT_FPS:
        pair = resampled(motions, FIT_FPS).pair(source, target)
    judged = fit_and_judge(pair, method, preset, seed=seed, progress=progress, **options)
    path = save_mapping(judged.mapping, base)
    write_json(_record_of(base), {"format": _FORMAT, "sources": names, **judged.as_dict()})
    return OwnFit(judged, path, tuple(names), notices)


def _both_ways(motions: Motions) -> list[tuple[str, str]]:
    return [edge for a, b in motions.pairs for edge in ((a, b), (b, a))]


def _ends(parts: Sequence[Motions], ends: tuple[str, str] | None) -> tuple[str, str]:
    """The pair to fit: as asked for, or the only one that a person leads."""
    known = list(dict.fromkeys(pair for part in parts for pair in part.pairs))
    if ends is not None:
        if ends not in [edge for a, b in known for edge in ((a, b), (b, a))]:
            there = ", ".join(f"{a} and {b}" for a, b in known) or "none"
            raise MotionError(f"no recordings of {ends[0]!r} with {ends[1]!r}; pairs in the data: {there}")
        return ends
    if len(known) != 1:
        there = ", ".join(f"{a} and {b}" for a, b in known) or "none"
        raise OptionError(f"the data hold {len(known)} pairs ({there}): say which with --from and --to")
    a, b = known[0]
    part = next(part for part in parts if known[0] in part.pairs)
    return (b, a) if part.bodies[b].kind == "human" and part.bodies[a].kind == "robot" else (a, b)


def _base(out: str | os.PathLike[str] | None, source: str, target: str) -> Path:
    if out is None:
        return own_mappings_folder() / f"{source}-{target}"
    path = Path(out)
    return path.with_suffix("") if path.suffix in (".safetensors", ".json") else path


def _record_of(base: Path) -> Path:
    """Beside the mapping, in a folder of its own, so that a folder of mappings holds mappings alone."""
    return base.parent / "fits" / f"{base.name}.json"


def _sources_of(base: Path) -> list[str]:
    path = _record_of(base)
    if not path.is_file():
        raise StorageError(f"{path} is missing, so there is nothing to add to; fit without --add first")
    content = read_json(path)
    names = content.get("sources") if isinstance(content, dict) and content.get("format") == _FORMAT else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise StorageError(f"{path} does not list data sets; fit again without --add, naming all of them")
    return names


def _load_again(name: str, base: Path) -> Motions:
    try:
        return load_motions(name)
    except MotionError as error:
        raise StorageError(
            f"{base.name} was fitted on {name}, which cannot be read any more ({error}); fit again without --add, "
            "naming all data sets"
        ) from error


def _located(name: str) -> str:
    """A spec of ``load_motions`` that means the same from any folder."""
    prefix, colon, rest = name.partition(":")
    if name == "embedded" or (colon and not rest):
        return name
    if colon and prefix in FORMATS:
        return f"{prefix}:{Path(rest).expanduser().resolve()}"
    return str(Path(name).expanduser().resolve())
