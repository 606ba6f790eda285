"""Inbox: between the thread that receives and the loop that decides; the newest packet wins."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from syda_gym.teleoperation.incoming import clock as live_clock
from syda_gym.teleoperation.incoming.packets import Packet

__all__ = ["Inbox", "Received"]

_MAX_REQUESTS = 64
_HALTING = ("stop", "pause")


class Received(NamedTuple):
    """What the loop takes from the inbox.

    Attributes:
        packet: the newest frame, or ``None``.
        arrived: when it arrived on the receiver's clock [s].
        controls: requests since the last time, in order.
    """

    packet: Packet | None
    arrived: float
    controls: tuple[str, ...]


class Inbox:
    """Holds one frame, the newest, and every request in order.

    Args:
        rouse: called after a request or the end came, to wake a source that waits for something else than the inbox.
        clock: tells when a request from this side came.

    Attributes:
        halted: when the last stop or pause came [s], whoever asked; minus infinity before.
        dropped: how many packets were dropped, by reason; a frame that a newer one replaced counts as ``overtaken``.
    """

    def __init__(self, rouse: Callable[[], None] | None = None, clock: Callable[[], float] = live_clock.clock) -> None:
        self._rouse = rouse
        self._clock = clock
        self.halted = -math.inf
        self.dropped: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._condition = threading.Condition(self._lock)
        self._room = threading.Condition(self._lock)
        self._listening = False
        self._packet: Packet | None = None
        self._arrived = 0.0
        self._controls: list[str] = []
        self._closed = False

    def put(self, packet: Packet, arrived: float) -> None:
        """Delivers a packet that arrived at ``arrived`` [s]."""
        with self._condition:
            if packet.control is not None:
                self._request(packet.control, arrived)
            if packet.frame is not None:
                if self._packet is not None:
                    self.dropped["overtaken"] += 1
                self._packet, self._arrived = packet, arrived
            self._condition.notify()

    def request(self, control: str) -> None:
        """Delivers a request that comes from this side, for example from the keyboard."""
        with self._condition:
            self._request(control, self._clock())
            self._condition.notify()
        if self._rouse is not None:
            self._rouse()

    def drop(self, reason: str) -> None:
        """Counts a packet that was dropped."""
        with self._condition:
            self.dropped[reason] += 1

    def wait_for_room(self) -> bool:
        """Waits until somebody listens and the last frame was taken; false once the inbox is closed.

        For sources that can wait, as a recording can and a camera cannot.
        """
        with self._lock:
            self._room.wait_for(lambda: self._closed or (self._listening and self._packet is None))
            return not self._closed

    def take(self, timeout: float) -> Received:
        """Waits up to ``timeout`` seconds for something and takes it; empty-handed after that."""
        with self._condition:
            self._listening = True
            self._room.notify()
            if self._packet is None and not self._controls and not self._closed and timeout > 0.0:
                self._condition.wait(timeout)
            packet, controls = self._packet, tuple(self._controls)
            self._packet = None
            self._room.notify()
            self._controls.clear()
            return Received(packet, self._arrived, controls)

    def close(self) -> None:
        """No more packets will come; waiting ends at once from now on."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
            self._room.notify_all()
        if self._rouse is not None:
            self._rouse()

    def reopen(self) -> None:
        """Something may come again: requests, while a robot goes home after the end."""
        with self._condition:
            self._closed = False

    @property
    def filled(self) -> bool:
        """Whether there is something to take."""
        return self._packet is not None or bool(self._controls)

    @property
    def closed(self) -> bool:
        """Whether no more packets will come."""
        return self._closed

    def _request(self, control: str, now: float) -> None:
        if control in _HALTING:
            self.halted = max(self.halted, now)
        if self._controls and self._controls[-1] == control:  # once more is the same
            return
        if len(self._controls) < _MAX_REQUESTS:
            self._controls.append(control)
        elif control in _HALTING:  # these always have room, and nothing that stands behind them lifts them
            self._controls[-1] = "stop" if "stop" in (control, self._controls[-1]) else control
        else:
            self.dropped["requests"] += 1
