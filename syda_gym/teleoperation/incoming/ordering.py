"""Ordering: which of the packets that arrive are newer than all before; the rest is late, doubled or out of order."""

from __future__ import annotations

from collections.abc import Hashable

from syda_gym.teleoperation.incoming.packets import Packet

__all__ = ["STREAM_REASONS", "Ordering"]

STREAM_REASONS = ("duplicate", "reordered", "late")
"""Reasons that are ordinary on a network and nobody's mistake."""


class Ordering:
    """Lets a packet pass if it is newer than every packet that passed before it.

    Newer means a greater sequence number and a sender's time that is not earlier. A sender that starts again begins
    with small numbers; it is let in once nothing has passed for ``restart`` seconds, so that neither a restart nor one
    packet with a huge number locks the stream for longer. Packets that took ``late`` seconds more than the fastest one
    so far are too old to act on. One sender drives at a time: frames of another one pass only after such a silence.
    Requests pass from anybody, for an emergency stop may come from a second machine.

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

    def admit(self, packet: Packet, now: float, sender: Hashable = None) -> str:
        """Empty if the packet may pass at ``now`` [s], else the reason why not in one word.

        Requests are never too late or out of order: an emergency stop is obeyed however old. Only the driver's own
        duplicates are dropped.
        """
        stranger = sender != self._sender
        silent = self._passed_at is None or now - self._passed_at > self.restart
        if packet.control is not None and (stranger or packet.sequence != self._sequence):
            return ""
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

    def _begin(self, packet: Packet, now: float, sender: Hashable) -> None:
        self._sender = sender
        self._sequence, self._sent, self._passed_at = packet.sequence, packet.sent, now
        self._fastest = now - packet.sent
