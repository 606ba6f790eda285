"""What the cockpit says in words: what the loop does, why it is slow or still, and where the time goes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from syda_gym.teleoperation.incoming.camera import PictureSource
from syda_gym.teleoperation.incoming.sources import Source
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.tick import Decision, State

__all__ = ["latency_words", "status_text"]

_SAID = {
    State.CALIBRATING: "calibrating: stand still with hanging arms",
    State.FOLLOWING: "following",
    State.HOLDING: "holding",
    State.EASING: "easing to rest",
    State.RESTING: "resting",
    State.PAUSED: "paused",
    State.STOPPED: "EMERGENCY STOP: press Release, then Go on",
}


def status_text(
    loop: TeleoperationLoop,
    source: Source,
    stats: LiveStatistics,
    decision: Decision,
    reasons: Sequence[str],
    recording: str,
) -> str:
    """Markdown for the page.

    Args:
        loop: that decides.
        source: where frames come from.
        stats: of the run.
        decision: the latest.
        reasons: why the robot was slowed, held or a frame dropped in the last moment.
        recording: what is being recorded; empty for nothing.
    """
    lines = [f"### {_SAID[decision.state]}"]
    if decision.state is State.FOLLOWING and decision.factor < 1.0:
        lines.append(f"speed {100 * decision.factor:.0f} %")
    if loop.calibration is None and loop.calibration_message:
        lines.append(_plain(loop.calibration_message))
    lines += [f"- {_plain(reason)}" for reason in reasons if reason != "calibrating"]
    if recording:
        lines.append(f"**{_plain(recording)}**")
    lines.append(_plain(latency_words(source, stats)))
    dropped = [f"{reason} {count}" for reason, count in source.inbox.dropped.most_common(3)]
    if dropped:
        lines.append(_plain("dropped: " + ", ".join(dropped)))
    lines += [f"- {_plain(notice)}" for notice in loop.notices[:4]]
    return "\n\n".join(lines).replace("\n\n- ", "\n- ")


def latency_words(source: Source, stats: LiveStatistics) -> str:
    """Where the time from a frame, or from a picture, to its command goes, in one line."""
    loop = f"arrival to command {_ms(1e3 * stats.percentile(50))} (99 %: {_ms(1e3 * stats.percentile(99))})"
    if not isinstance(source, PictureSource):
        return loop
    parts = source.parts()
    whole = parts["picture_to_frame_p50_ms"] + 1e3 * stats.percentile(50)
    return (
        f"picture to command {_ms(whole)}: waiting {_ms(parts['wait_p50_ms'])}, pose model "
        f"{_ms(parts['pose_p50_ms'])}, joints {_ms(parts['joints_p50_ms'])}, {loop}"
    )


def _ms(value: float) -> str:
    return f"{value:.2f} ms" if math.isfinite(value) else "unknown"


def _plain(text: str) -> str:
    """Text without what Markdown would take for its own; names come from files and packets."""
    text = text.replace(" > ", " to ")  # of routes
    for sign in "\\`*_{}[]<>#|$":
        text = text.replace(sign, " " if sign in "`{}[]<>#|$\\" else f"\\{sign}")
    return text
