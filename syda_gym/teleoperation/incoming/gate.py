"""Gates: how many connections and packets one sender gets before anybody looks at what it sends."""

from __future__ import annotations

import contextlib
import socket
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

__all__ = ["GuardedListener", "JunkGate"]

_SENDERS = 256  # that are remembered


class JunkGate:
    """Spares the reader senders that send junk.

    Each sender may send some packets that are refused; whoever sends more of them is not read for a while. All senders
    together have such an allowance too, so that a flood from many addresses is not read either; only the driver and
    packets that ask for a stop are then. Looking at a packet costs a hundred times as much as throwing it away.

    Args:
        each: refused packets per second of one sender.
        all_together: refused packets per second.
        burst: seconds' worth that may come at once.
    """

    def __init__(self, each: float = 100.0, all_together: float = 300.0, burst: float = 1.0) -> None:
        self._each, self._all, self._burst = each, all_together, burst
        self._left: OrderedDict[Hashable, tuple[float, float]] = OrderedDict()  # packets left, when that was
        self._total = (burst * all_together, 0.0)

    def admits(self, sender: Hashable, now: float, driver: bool = False) -> bool:
        """Whether a packet of this sender is read at ``now`` [s]."""
        left, since = self._left.get(sender, (self._burst * self._each, now))
        if left + (now - since) * self._each < 1.0:
            return False
        return driver or self._total[0] + (now - self._total[1]) * self._all >= 1.0

    def refused(self, sender: Hashable, now: float) -> None:
        """A packet of this sender was refused at ``now`` [s]."""
        left, since = self._left.pop(sender, (self._burst * self._each, now))
        self._left[sender] = _spent(left, since, now, self._each, self._burst), now
        if len(self._left) > _SENDERS:
            self._left.popitem(last=False)
        self._total = _spent(*self._total, now, self._all, self._burst), now


def _spent(left: float, since: float, now: float, rate: float, burst: float) -> float:
    return max(min(burst * rate, left + (now - since) * rate) - 1.0, -1.0)


class GuardedListener(socket.socket):
    """A listening socket that closes at once what is more than one address, or all of them, may hold open.

    The server behind it starts a thread per connection and waits for its handshake; here connections are counted before
    that.

    Attributes:
        refused: called for each connection that was closed.
        each: connections of one address.
        most: connections of all together.
        per_second: new connections of one address per second.
        clock: tells the time [s].
    """

    refused: Callable[[], None]
    clock: Callable[[], float]
    each: int = 8
    most: int = 32
    per_second: float = 10.0

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection that may stay.

        Raises:
            OSError: the listener was closed, or the system has no descriptor left.
        """
        while True:
            connection, address = super().accept()
            if self._admits(connection, str(address[0])):
                return connection, address
            self.refused()
            with contextlib.suppress(OSError):
                connection.close()

    def _admits(self, connection: socket.socket, host: str) -> bool:
        state = self.__dict__
        opened: list[tuple[str, socket.socket]] = [one for one in state.get("opened", []) if one[1].fileno() != -1]
        rates: OrderedDict[str, tuple[float, float]] = state.setdefault("rates", OrderedDict())
        now = self.clock()
        left, since = rates.pop(host, (self.per_second, now))
        left = min(self.per_second, left + (now - since) * self.per_second)
        admitted = left >= 1.0 and len(opened) < self.most and sum(one == host for one, _ in opened) < self.each
        rates[host] = (left - 1.0 if left >= 1.0 else left), now
        if len(rates) > _SENDERS:
            rates.popitem(last=False)
        if admitted:
            opened.append((host, connection))
        state["opened"] = opened
        return admitted
