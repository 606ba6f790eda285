"""Ordering: which of the packets that arrive are newer than all before; the rest is late, doubled or out of order."""

from __future__ import annotations

import math
from collections.abc import Hashable

from syda_gym.teleoperation.incoming.packets import Packet
from syda_gym.teleoperation.tick import RESTRAINING

__all__ = ["STREAM_REASONS", "Ordering"]

STREAM_REASONS = ("duplicate", "reordered", "late")
"""Reasons that are ordinary on a network and nobody's mistake."""


class Ordering:
    """Lets a packet pass if it is newer than every packet that passed before it.

    Newer means a greater sequence number and a sender's time that is not earlier. A sender that starts again begins
    with small numbers; it is let in once nothing has passed for ``restart`` seconds, so that neither a restart nor one
    packet with a huge number locks the stream for longer. Packets that took ``late`` seconds more than the fastest one
    so far are too old to act on. One sender drives at a time: frames of another one pass only after such a silence.

    What restrains the robot (stop, pause, rest) passes from anybody, however late, doubled or out of order, for an
    emergency stop may come from a second machine. What sets it free (release, resume, calibrate) passes only from the
    driver, once, and only if it left the driver after the last stop or pause had arrived here.

    Args:
        restart: silence after which the order starts anew [s].
        late: greatest delay beyond the fastest packet's [s].

    Attributes:
        lost: sequence numbers that never arrived in order.
    """

    def __init__(self, restart: float = 1.0, late: float = 0.5) -> None:
        self.restart = restart
        self.late = late
        self.lost = 0
        self._sequence = -1
        self._sent = 0.0
        self._passed_at: float | None = None
        self._sender: Hashable = None
        self._fastest = 0.0
        self._request = -1  # greatest number of the driver's requests

    def admit(self, packet: Packet, now: float, sender: Hashable = None, halted: float = -math.inf) -> str:
        """Empty if the packet may pass at ``now`` [s], else the reason why not in one word.

        Args:
            packet: to judge.
            now: our clock [s].
            sender: where it came from.
            halted: when the last stop or pause arrived, from wherever [s].
        """
        stranger = self._passed_at is None or sender != self._sender
        if packet.control is not None:
            if packet.control in RESTRAINING:
                if not stranger:
                    self._request = max(self._request, packet.sequence)
                return ""
            return "stranger" if stranger else self._free(packet, now, halted)
        silent = self._passed_at is None or now - self._passed_at > self.restart
        if silent:
            self._begin(packet, now, sender)
            return ""
        if stranger:
            return "stranger"
        if packet.sequence == self._sequence:
            return "duplicate"
        if packet.sequence < self._sequence or packet.sent < self._sent:
            return "reordered"
        delay = now - packet.sent
        self._fastest = min(self._fastest, delay)
        if delay - self._fastest > self.late:
            return "late"
        self.lost += min(packet.sequence - self._sequence - 1, 1_000_000)
        self._sequence, self._sent, self._passed_at = packet.sequence, packet.sent, now
        return ""

    def drives(self, sender: Hashable) -> bool:
        """Whether this sender's frames are the ones that pass."""
        return self._passed_at is not None and sender == self._sender

    def _free(self, packet: Packet, now: float, halted: float) -> str:
        """Whether the driver's request to set the robot free may pass."""
        if packet.sequence <= max(self._request, self._sequence) or packet.sent < self._sent:
            return "stale"
        delay = now - packet.sent
        if delay - self._fastest > self.late:
            return "late"
        # By the fastest packet's delay, this one left no later than:
        if now - max(delay - self._fastest, 0.0) <= halted:
            return "stale"
        self._request = packet.sequence
        return ""

    def _begin(self, packet: Packet, now: float, sender: Hashable) -> None:
        if sender != self._sender:
            self._request = -1
        self._sender = sender
        self._sequence, self._sent, self._passed_at = packet.sequence, packet.sent, now
        self._fastest = now - packet.sent
