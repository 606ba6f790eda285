"""Sources: where operator frames come from: a recording at its own speed, UDP, or a WebSocket."""

from __future__ import annotations

import contextlib
import ipaddress
import math
import select
import socket
import threading
import time
from collections.abc import Callable, Hashable
from typing import Any

from syda_gym.embodiments.embodiment import Embodiment
from syda_gym.errors import MissingExtraError, OptionError, TeleoperationError
from syda_gym.motions.clip import MotionClip
from syda_gym.teleoperation.incoming.inbox import Inbox, Received
from syda_gym.teleoperation.incoming.ordering import STREAM_REASONS, Ordering
from syda_gym.teleoperation.incoming.packets import MAX_BYTES, Packet, PacketDecoder, PacketError

__all__ = ["ReplaySource", "Source", "UdpSource", "WebSocketSource", "is_loopback", "require_token"]

_POLL = 0.2  # s; how often a receiving thread looks whether it should end
_BURST = 64  # packets that are read at once before the loop gets its turn


class Source:
    """Delivers frames of one body into an inbox, from a thread of its own unless it can do without.

    Attributes:
        inbox: what came and was not taken yet.
        body: whose frames they are.
        threaded: whether frames come through a thread of this process.
    """

    threaded = True

    def __init__(self, body: Embodiment, clock: Callable[[], float] = time.monotonic) -> None:
        self.body = body
        self.inbox = Inbox()
        self.clock = clock
        self._ending = threading.Event()
        self._started = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begins to deliver.

        Raises:
            TeleoperationError: started twice, or the address cannot be used.
        """
        if self._started:
            raise TeleoperationError(f"{type(self).__name__} was started already; make a new one")
        self._open()
        self._started = True
        self._begin()

    def take(self, timeout: float) -> Received:
        """Waits up to ``timeout`` seconds for a frame or a request and takes it; empty-handed after that."""
        return self.inbox.take(timeout)

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
        clock: Callable[[], float] = time.monotonic,
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
        self._lock = threading.Lock()

    def _accept(self, data: bytes | str, sender: Hashable) -> PacketError | None:
        now = self.clock()
        try:
            packet = self._decoder(data)
            with self._lock:
                late = self._ordering.admit(packet, now, sender)
            if late:
                raise PacketError(late, f"packet {packet.sequence} is {late}")
        except PacketError as error:
            self.inbox.drop(error.reason)
            return error
        self.inbox.put(packet, now)
        return None


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
        clock: Callable[[], float] = time.monotonic,
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
            # Not epoll, which counts in whole milliseconds.
            ready, _, _ = select.select(self._ears, (), (), left)
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
        for opened in (self._socket, *(self._bell or ())):
            if opened is not None:
                opened.close()

    def _receive(self) -> None:
        assert self._socket is not None  # opened by start; for the type checker
        for _ in range(_BURST):
            try:
                data, sender = self._socket.recvfrom(MAX_BYTES + 1)
            except OSError:  # no more, or an ICMP error of an earlier answer
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
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(body, host, port, token, clock)
        self.origins = origins
        self._server: Any = None

    def _open(self) -> None:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise MissingExtraError("a WebSocket source", "live") from error
        try:
            self._server = serve(
                self._serve_one,
                self.host,
                self.port,
                origins=[None, *self.origins],  # type: ignore[list-item]
                max_size=MAX_BYTES,
                max_queue=4,
                compression=None,
            )
        except OSError as error:
            raise TeleoperationError(
                f"cannot listen on ws://{self.host}:{self.port}: {error.strerror or error}; "
                "choose another address or port"
            ) from error
        self.port = int(self._server.socket.getsockname()[1])

    def _shut(self) -> None:
        if self._server is not None:
            self._server.shutdown()

    def _run(self) -> None:
        self._server.serve_forever()

    def _serve_one(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        sender = object()
        with contextlib.suppress(ConnectionClosed):
            while not self._ending.is_set():
                try:
                    message = connection.recv(timeout=_POLL)
                except TimeoutError:
                    continue
                error = self._accept(message, sender)
                if error is not None and error.reason not in STREAM_REASONS:
                    connection.send(f'{{"dropped": "{error.reason}"}}')


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
