"""Network sources: frames and requests as JSON packets over UDP or a WebSocket, from senders that may be anybody."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Hashable
from typing import Any

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MissingExtraError, OptionError, TeleoperationError
from syda_gym.teleoperation.incoming import clock as live_clock
from syda_gym.teleoperation.incoming.gate import GuardedListener, JunkGate
from syda_gym.teleoperation.incoming.inbox import Inbox, Received
from syda_gym.teleoperation.incoming.ordering import STREAM_REASONS, Ordering
from syda_gym.teleoperation.incoming.packets import MAX_BYTES, PacketDecoder, PacketError
from syda_gym.teleoperation.incoming.sources import Source

__all__ = ["UdpSource", "WebSocketSource", "is_loopback", "require_token"]

_POLL = 0.2  # s; how often a receiving thread looks whether it should end
_BURST = 64  # packets that are read at once before the loop gets its turn
_BUFFER = 1 << 20  # bytes of packets that may wait in the system, so that a flood does not wash out the driver's
_AGAIN = 0.5  # s between two attempts to listen again
_HANDSHAKE = 2.0  # s
_LONGEST_STOP = 512  # bytes of a packet that may be an emergency stop
_FASTEST = 1e-3  # s between two messages of one connection, on average


class _NetworkSource(Source):
    """What UDP and WebSocket share: an address, a token, decoding and ordering."""

    def __init__(self, body: Embodiment, host: str, port: int, token: str | None, clock: Callable[[], float]) -> None:
        require_token(host, token)
        if not 0 <= port <= 65535:
            raise OptionError(f"port must be between 0 and 65535, got {port}")
        super().__init__(body, clock)
        self.host = host
        self.port = port
        self._decoder = PacketDecoder(body, token)
        self._ordering = Ordering()
        self._junk = JunkGate()
        self._stops = JunkGate(each=100.0, all_together=100.0)
        self._lock = threading.Lock()

    def _accept(self, data: bytes | str, sender: Hashable) -> PacketError | None:
        now = self.clock()
        stop = False
        if not self._junk.admits(sender, now, self._ordering.drives(sender)):
            stop = self._may_stop(data) and self._stops.admits(sender, now)
            if not stop:
                self.inbox.drop("unread")
                return _UNREAD
        try:
            packet = self._decoder(data)
            with self._lock:
                late = self._ordering.admit(packet, now, sender, self.inbox.halted)
            if late:
                raise PacketError(late, f"packet {packet.sequence} is {late}")
        except PacketError as error:
            self.inbox.drop(error.reason)
            if error.reason not in STREAM_REASONS:
                (self._stops if stop else self._junk).refused(sender, now)
            return error
        self.inbox.put(packet, now)
        return None

    @staticmethod
    def _may_stop(data: bytes | str) -> bool:
        """Whether a packet asks for an emergency stop by the look of it."""
        if len(data) > _LONGEST_STOP:
            return False
        return '"stop"' in data if isinstance(data, str) else b'"stop"' in data

    def _revive(self, why: object) -> None:
        """Listens again after the listener died, and says so."""
        if self._ending.is_set():
            return
        try:
            self._shut_listener()
            self._open()
        except Exception as error:  # the port is still taken, or there is no descriptor left
            self._news.append(f"the listener on port {self.port} died ({why}) and cannot be started: {error}")
            self._ending.wait(_AGAIN)
        else:
            self._news.append(f"the listener on port {self.port} died ({why}) and was started anew")

    def _shut_listener(self) -> None:
        """Frees the address and leaves the inbox open."""


class UdpSource(_NetworkSource):
    """Listens for packets on UDP; see ``packets.PacketDecoder`` for what they hold.

    Whoever takes a frame reads the socket; a thread in between would cost a handover per frame.

    Args:
        body: whose frames arrive.
        host: address to listen on; anything but loopback needs a token.
        port: port; 0 lets the system choose, ``port`` tells which after ``start``.
        token: secret that every packet must carry.
        clock: of the loop.

    Raises:
        OptionError: an address beyond loopback without a token, or a port that is none.
    """

    threaded = False

    def __init__(
        self,
        body: Embodiment,
        host: str = "127.0.0.1",
        port: int = 9870,
        token: str | None = None,
        clock: Callable[[], float] = live_clock.clock,
    ) -> None:
        super().__init__(body, host, port, token, clock)
        self.inbox = Inbox(self._rouse)
        self._socket: socket.socket | None = None
        self._bell: tuple[socket.socket, socket.socket] | None = None
        self._ears: list[socket.socket] = []
        self._latest = b""

    def take(self, timeout: float) -> Received:
        """Reads what has arrived, or waits for it up to ``timeout`` seconds; packets that are refused do not count."""
        end = time.monotonic() + timeout
        while not (self.inbox.filled or self.inbox.closed):
            left = max(0.0, end - time.monotonic())
            try:
                # Not epoll, which counts in whole milliseconds.
                ready, _, _ = select.select(self._ears, (), (), left)
            except (OSError, ValueError) as error:  # somebody closed our socket
                self._revive(error)
                break
            if self._socket in ready:
                self._receive()
            if self._bell and self._bell[0] in ready:
                self._hear()
            if left == 0.0:
                break
        return self.inbox.take(0.0)

    def rehearse(self) -> None:
        """Decodes the last packet again."""
        if self._latest:
            with contextlib.suppress(PacketError):
                self._decoder(self._latest)

    def _open(self) -> None:
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._socket.bind(address)
        except OSError as error:
            if self._socket is not None:
                self._socket.close()
            raise TeleoperationError(
                f"cannot listen on udp {self.host}:{self.port}: {error.strerror or error}; "
                "choose another address or port"
            ) from error
        self.port = int(self._socket.getsockname()[1])
        self._bell = socket.socketpair()
        for end in self._bell:
            end.setblocking(False)
        self._ears = [self._socket, self._bell[0]]

    def _begin(self) -> None:
        """No thread: ``take`` reads."""

    def _shut(self) -> None:
        self.inbox.close()
        self._shut_listener()

    def _shut_listener(self) -> None:
        for opened in (self._socket, *(self._bell or ())):
            if opened is not None:
                opened.close()

    def _receive(self) -> None:
        assert self._socket is not None  # opened by start; for the type checker
        for _ in range(_BURST):
            try:
                data, sender = self._socket.recvfrom(MAX_BYTES + 1)
            except OSError as error:  # no more, or an ICMP error of an earlier answer
                if self._socket.fileno() == -1:
                    self._revive(error)
                return
            self._latest = data
            self._accept(data, sender)

    def _rouse(self) -> None:
        if self._bell is not None:
            with contextlib.suppress(OSError):  # ringing already, or closed
                self._bell[1].send(b"!")

    def _hear(self) -> None:
        if self._bell is not None:
            with contextlib.suppress(OSError):
                self._bell[0].recv(4096)


class WebSocketSource(_NetworkSource):
    """Serves a WebSocket whose messages are the same packets; a rejected packet is answered with the reason.

    Browsers may connect to loopback from any page, so that connections with an ``Origin`` header are refused unless the
    origin is listed.

    Args:
        body: whose frames arrive.
        host: address to listen on; anything but loopback needs a token.
        port: port; 0 lets the system choose.
        token: secret that every packet must carry.
        origins: web pages that may connect, such as ``http://localhost:8000``.
        clock: of the loop.

    Raises:
        MissingExtraError: ``websockets`` is not installed.
        OptionError: an address beyond loopback without a token, or a port that is none.
    """

    def __init__(
        self,
        body: Embodiment,
        host: str = "127.0.0.1",
        port: int = 9871,
        token: str | None = None,
        origins: tuple[str, ...] = (),
        clock: Callable[[], float] = live_clock.clock,
    ) -> None:
        super().__init__(body, host, port, token, clock)
        self.origins = origins
        self._server: Any = None

    def _open(self) -> None:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise MissingExtraError("a WebSocket source", "live") from error
        listener = self._listen()
        self._server = serve(
            self._serve_one,
            sock=listener,
            origins=[None, *self.origins],  # type: ignore[list-item]
            open_timeout=_HANDSHAKE,
            max_size=MAX_BYTES,
            max_queue=4,
            compression=None,
            logger=_SILENT,
        )
        self.port = int(listener.getsockname()[1])

    def _listen(self) -> GuardedListener:
        listener: GuardedListener | None = None
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_STREAM)[0]
            listener = GuardedListener(family, kind, protocol)
            listener.refused, listener.clock = lambda: self.inbox.drop("connections"), self.clock
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen()
        except OSError as error:
            if listener is not None:
                listener.close()
            raise TeleoperationError(
                f"cannot listen on ws://{self.host}:{self.port}: {error.strerror or error}; "
                "choose another address or port"
            ) from error
        return listener

    def _shut(self) -> None:
        self._shut_listener()

    def _shut_listener(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            with contextlib.suppress(OSError):
                server.shutdown()

    def _run(self) -> None:
        while not self._ending.is_set():
            server, why = self._server, "it ended"
            if server is not None:
                try:
                    server.serve_forever()
                except Exception as error:  # no thread or descriptor left
                    why = repr(error)
                self._shut_listener()
                for end in (server.shutdown_watcher, server.shutdown_notifier):
                    with contextlib.suppress(OSError):
                        os.close(end)
            if not self._ending.is_set():
                self._ending.wait(_AGAIN)
                self._revive(why)

    def _serve_one(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        sender = object()
        begun, count = time.monotonic(), 0
        with contextlib.suppress(ConnectionClosed):
            while not self._ending.is_set():
                try:
                    message = connection.recv(timeout=_POLL)
                except TimeoutError:
                    begun, count = time.monotonic(), 0
                    continue
                count += 1
                ahead = begun + count * _FASTEST - time.monotonic()
                if ahead > _POLL:
                    time.sleep(ahead)  # the sender waits, and the loop has its processor
                error = self._accept(message, sender)
                if error is _UNREAD:
                    connection.close(1008, "too many packets that had to be refused")
                    return
                if error is not None and error.reason not in STREAM_REASONS:
                    connection.send(f'{{"dropped": "{error.reason}"}}')


_UNREAD = PacketError("unread", "too many packets of this sender had to be refused; it is not read for a while")
_SILENT = logging.getLogger("syda_gym.websockets")
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False  # strangers that do not speak the protocol are no news


def is_loopback(host: str) -> bool:
    """Whether an address only reaches this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def require_token(host: str, token: str | None) -> None:
    """Refuses an address beyond this machine without a token of at least eight characters.

    Raises:
        OptionError: no token, or a short one.
    """
    if token is not None and len(token) < 8:
        raise OptionError(
            "the token must have at least 8 characters; make one with: python -c 'import secrets; "
            "print(secrets.token_urlsafe())'"
        )
    if not is_loopback(host) and token is None:
        raise OptionError(
            f"{host} can be reached from other machines; give a token that both sides know (--token-file), "
            "or use 127.0.0.1"
        )
