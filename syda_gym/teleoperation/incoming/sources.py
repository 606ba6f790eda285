"""Sources: where operator frames come from; here a recording at its own speed."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import OptionError, TeleoperationError
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.incoming import clock as live_clock
from syda_gym.teleoperation.incoming.inbox import Inbox, Received
from syda_gym.teleoperation.incoming.packets import Packet

__all__ = ["ReplaySource", "Source"]


class Source:
    """Delivers frames of one body into an inbox, from a thread of its own unless it can do without.

    Attributes:
        inbox: what came and was not taken yet.
        body: whose frames they are.
        threaded: whether frames come through a thread of this process.
    """

    threaded = True

    def __init__(self, body: Embodiment, clock: Callable[[], float] = live_clock.clock) -> None:
        self.body = body
        self.inbox = Inbox(clock=clock)
        self.clock = clock
        self._news: list[str] = []
        self._ending = threading.Event()
        self._held = False
        self._started = False
        self._thread: threading.Thread | None = None

    def hold(self) -> None:
        """Takes hold of the address without delivering yet, so that what is wrong with it is known; repeated, nothing.

        Raises:
            TeleoperationError: the address cannot be used.
        """
        if self._held:
            return
        try:
            self._open()
        except BaseException:
            self._shut()  # what was opened before the failure, a model for example
            raise
        self._held = True

    def start(self) -> None:
        """Begins to deliver.

        Raises:
            TeleoperationError: started twice, or the address cannot be used.
        """
        if self._started:
            raise TeleoperationError(f"{type(self).__name__} was started already; make a new one")
        self.hold()
        self._started = True
        self._begin()

    def take(self, timeout: float) -> Received:
        """Waits up to ``timeout`` seconds for a frame or a request and takes it; empty-handed after that."""
        return self.inbox.take(timeout)

    def news(self) -> list[str]:
        """What a person should know and has not been told yet, such as a listener that had to be started anew."""
        if not self._news:
            return []
        news, self._news = self._news, []
        return news

    def rehearse(self) -> None:
        """Does what ``take`` does with a frame, without one, so that the next frame is read faster."""

    def close(self) -> None:
        """Ends the thread and frees the address."""
        self._ending.set()
        self._shut()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        self.inbox.close()

    def __enter__(self) -> Source:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> None:
        """Takes hold of an address; runs in the caller's thread so that errors reach the caller."""

    def _shut(self) -> None:
        """Frees the address."""

    def _begin(self) -> None:
        """Starts the thread."""
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Delivers until ``_ending`` is set; runs in the thread."""


class ReplaySource(Source):
    """Plays clips at their own speed, to somebody who listens.

    It begins when the loop first takes a frame, and waits for a loop that is late, on a busy machine for example, so
    that no frame of a recording is ever lost.

    Args:
        clips: of one body, played one after the other.
        speed: 2 plays twice as fast; the standing takes its time.
        repeat: begin again at the end.
        stand: seconds for which the first frame's body stands first, for the calibration.
        clock: of the loop.

    Raises:
        OptionError: no clips, clips of several bodies, or a speed that is not positive.
    """

    def __init__(
        self,
        clips: tuple[MotionClip, ...] | list[MotionClip],
        *,
        speed: float = 1.0,
        repeat: bool = False,
        stand: float = 0.0,
        clock: Callable[[], float] = live_clock.clock,
    ) -> None:
        if not clips or len({clip.body.name for clip in clips}) != 1:
            raise OptionError("a replay needs clips of exactly one body")
        if not 0.0 < speed <= 1000.0:
            raise OptionError(f"replay speed must be between 0 and 1000, got {speed}")
        super().__init__(clips[0].body, clock)
        self.clips = tuple(clips)
        self.speed = speed
        self.repeat = repeat
        self.stand = stand

    @property
    def seconds(self) -> float:
        """Duration of one pass [s], if the loop keeps up."""
        return self.stand + sum(clip.seconds for clip in self.clips) / self.speed

    def _run(self) -> None:
        sequence, due, begun = 0, 0.0, -math.inf
        while not self._ending.is_set():
            for frame, period in self._frames():
                if not self.inbox.wait_for_room():
                    return
                now = self.clock()
                if now - begun - due > period:  # the loop was late: what is left to play moves on with it
                    begun = now - due
                elif self._ending.wait(max(0.0, begun + due - now)):
                    return
                self.inbox.put(Packet(sequence, due, frame), self.clock())
                sequence += 1
                due += period
            if not self.repeat:
                break
        self._ending.wait(max(0.0, begun + due - self.clock()))
        self.inbox.close()

    def _shut(self) -> None:
        self.inbox.close()

    def _frames(self) -> Any:
        first = self.clips[0]
        if self.stand > 0.0 and hasattr(self.body, "standing"):
            for _ in range(int(self.stand * first.fps) + 2):
                yield self.body.standing(), 1.0 / first.fps
        for clip in self.clips:
            for frame in clip.frames:
                yield frame, 1.0 / (clip.fps * self.speed)
