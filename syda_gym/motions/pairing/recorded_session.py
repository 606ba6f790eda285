"""From an operator's recordings and a robot's prompts to a paired data set: match, align, judge."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.errors import MotionError, nearest_name
from syda_gym.motions.clip import MotionClip, Motions
from syda_gym.motions.how_to_read import AS_IT_STANDS, HowToRead
from syda_gym.motions.loading import FORMATS
from syda_gym.motions.pairing.alignment import ActionQuality, Alignment, pair_quality, pair_recordings

__all__ = ["Session", "operator_clips", "pair_session"]

_REPEAT = r"(-?(take|trial|rep|repeat|run|no|t|r|v)?-?\d+)?"
_ENDINGS = tuple(dict.fromkeys(ending for entry in FORMATS.values() for ending in entry.endings))


@dataclass(frozen=True, eq=False)
class Session:
    """What became of a recording session.

    Attributes:
        motions: the takes, ready for ``fit``, ``write_dataset`` and ``save_motions``.
        alignments: recording of each take to how it was aligned.
        quality: one entry per action, after alignment.
        left_out: operator recordings that matched no prompt, with the reason.
    """

    motions: Motions
    alignments: dict[str, Alignment]
    quality: tuple[ActionQuality, ...]
    left_out: dict[str, str]


def operator_clips(
    source: str | os.PathLike[str] | Motions, *, name: str = "operator", how: HowToRead = AS_IT_STANDS
) -> tuple[MotionClip, ...]:
    """Reads the recordings of one operator as clips of one body.

    The files of a folder give slightly different link lengths; the body gets their medians, frames stay as recorded.

    Args:
        source: a folder of recordings in any known formats, one file, or motions with one human.
        name: what to call the operator.
        how: what a person says about the files; it holds for every one of them.

    Raises:
        MotionError: no recordings, recordings of several humans, or of different arms.
        OptionError: something is said that does not fit.
    """
    clips = [clip for motions in _sources(source, how) for clip in _only_human(motions)]
    humans = [clip.body for clip in clips if isinstance(clip.body, HumanSkeleton)]
    first = humans[0]
    for human, clip in zip(humans, clips, strict=True):
        if human.sides != first.sides or not np.allclose(human.axes, first.axes):
            raise MotionError(f"{clip.recording}: other arms or axes than {clips[0].recording}; pair them separately")
    height, upper, fore, width = (
        float(np.median([getattr(human, part) for human in humans]))
        for part in ("height", "upper_arm", "forearm", "shoulders")
    )
    body = HumanSkeleton(
        name, height=height, upper_arm=upper, forearm=fore, shoulders=width, origin=first.origin, axes=first.axes,
        sides=first.sides,
    )  # fmt: skip
    return tuple(_as(clip, human, body) for clip, human in zip(clips, humans, strict=True))


def pair_session(
    operators: Sequence[MotionClip],
    prompts: Sequence[MotionClip],
    *,
    fps: float | None = None,
    max_lag: float = 1.0,
    same_clock: bool = False,
    name: str = "pairs",
) -> Session:
    """Pairs every operator recording with the prompt whose name it bears.

    A recording belongs to the prompt whose recording or action has its name, up to a number for the repeat:
    ``wave_high-2.csv``, ``Wave high take 2.csv`` and ``wave_high.csv`` belong to ``wave_high``. The longest such name
    wins; several recordings of one prompt are repeats.

    Args:
        operators: clips of one human, for example from ``operator_clips``.
        prompts: clips of one robot (or another body) that played.
        fps: frame rate of the pairs; by default the lowest of all clips.
        max_lag: largest shift either way [s].
        same_clock: operator and robot have timestamps of one clock.
        name: of the data set.

    Returns:
        The session; look at ``quality`` before trusting it.

    Raises:
        MotionError: nothing matches, or clips of several bodies on one side.
    """
    for label, clips in (("operators", operators), ("prompts", prompts)):
        bodies = {clip.body.name for clip in clips}
        if len(bodies) != 1:
            raise MotionError(f"{label} must be clips of one body, got {sorted(bodies) or 'none'}")
    rate = fps if fps is not None else min(clip.fps for clip in (*operators, *prompts))
    takes, alignments, left_out = [], {}, {}
    for clip in operators:
        prompt = _prompt_of(clip, prompts)
        if prompt is None:
            known = {p.action for p in prompts} | {p.recording for p in prompts}
            left_out[clip.recording] = f"bears no prompt's name; {nearest_name(clip.action, known)}"
            continue
        take, found = pair_recordings(clip, prompt, fps=rate, max_lag=max_lag, same_clock=same_clock)
        take = replace(take, recording=clip.recording)
        takes.append(take)
        alignments[take.recording] = found
    if not takes:
        raise MotionError(f"{name}: no recording matches a prompt: {next(iter(left_out.values()))}")
    human, robot = operators[0].body, prompts[0].body
    lags = [found.lag for found in alignments.values()]
    note = (
        f"aligned by limb directions: median lag of {human.name} {np.median(lags):+.2f} s, "
        f"from {min(lags):+.2f} to {max(lags):+.2f} s"
    )
    motions = Motions(name, tuple(takes), {human.name: human, robot.name: robot}, notes=(note,))
    return Session(motions, alignments, pair_quality(motions.pair(human.name, robot.name), max_lag=max_lag), left_out)


def _sources(source: str | os.PathLike[str] | Motions, how: HowToRead) -> list[Motions]:
    if isinstance(source, Motions):
        return [how.load(source)]
    path = Path(source)
    if not path.is_dir() or (path / "dataset.json").is_file():
        return [how.load(source)]
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in _ENDINGS)
    if not files:
        raise MotionError(f"{path} holds no recordings; expected files that end with {', '.join(_ENDINGS)}")
    return [how.load(file) for file in files]


def _only_human(motions: Motions) -> tuple[MotionClip, ...]:
    humans = [name for name, body in motions.bodies.items() if body.kind == "human"]
    if len(humans) != 1:
        raise MotionError(f"{motions.name} holds the humans {humans or 'none'}; expected exactly one operator")
    return motions.clips(humans[0])


def _as(clip: MotionClip, human: HumanSkeleton, body: HumanSkeleton) -> MotionClip:
    """The clip as one of ``body``: moved so that its shoulders are where the body's are."""
    shift = body.arm_points(body.standing())[0, :, 0].mean(axis=0) - human.arm_points(human.standing())[0, :, 0].mean(
        axis=0
    )
    return replace(clip, body=body, frames=body.frames_from_points(human.arm_points(clip.frames) + shift))


def _prompt_of(clip: MotionClip, prompts: Sequence[MotionClip]) -> MotionClip | None:
    own = [_plain(clip.action), _plain(clip.recording)]
    matching = [
        (len(label), -index)
        for index, prompt in enumerate(prompts)
        for label in (_plain(prompt.recording), _plain(prompt.action))
        if label and any(re.fullmatch(re.escape(label) + _REPEAT, text) for text in own)
    ]
    return prompts[-max(matching)[1]] if matching else None


def _plain(text: str) -> str:
    """Lower case with single dashes, the folder left out: ``Set/Wave High.01`` becomes ``wave-high-01``."""
    return re.sub(r"[^a-z0-9]+", "-", text.rsplit("/", 1)[-1].lower()).strip("-")
