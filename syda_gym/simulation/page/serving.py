"""A viser server behind a gate: nothing of it is reached without the token, and it reaches nothing beyond itself."""

from __future__ import annotations

import contextlib
import http.client
import socket
from collections.abc import Iterator
from typing import Any

from syda_gym.errors import MissingExtraError, TeleoperationError
from syda_gym.simulation.page.access import HEADERS, Gate

__all__ = ["serve"]


def serve(host: str, port: int, token: str, title: str) -> tuple[Any, str]:
    """Starts to serve, in this process, which serves nothing else.

    Args:
        host: address to listen on.
        port: 0 for any that is free.
        token: that opens the page.
        title: of the page.

    Returns:
        viser's server, and the address to open, with the token.

    Raises:
        MissingExtraError: viser is not installed.
        TeleoperationError: the address cannot be listened on, or the gate does not hold with this version of viser.
    """
    try:
        import viser
        import viser.infra
    except ImportError as error:
        raise MissingExtraError("the view", "view") from error
    _require_free(host, port)
    with _guarded(Gate(host, token)):
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        found = server.get_port()
        _require_gate(server, host, found)
    _forget_sharing(server)
    shown = f"[{host}]" if ":" in host else host
    return server, f"http://{shown}:{found}/?token={token}"


def _require_free(host: str, port: int) -> None:
    """Viser would take the next port in silence."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise TeleoperationError(
            f"the view cannot listen on {host}:{port}: {error.strerror or error}; choose another --view-address"
        ) from error


@contextlib.contextmanager
def _guarded(gate: Gate) -> Iterator[None]:
    """While it lasts, every WebSocket server of this process asks the gate first; viser has no such hook of its own."""
    import websockets.asyncio.server as module
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    original = module.serve

    class GuardedServe(original):  # type: ignore[misc, valid-type]
        def __init__(self, *args: Any, **options: Any) -> None:
            inner = options.pop("process_request", None)

            def process(connection: Any, request: Any) -> Any:
                answer = gate.answer(request.path, dict(request.headers.raw_items()))
                if answer is not None:
                    return Response(answer.status, "", Headers(answer.headers), answer.text.encode())
                response = None if inner is None else inner(connection, request)
                if response is not None:
                    host = request.headers.get("Host", "")
                    for name, value in HEADERS.items():
                        response.headers[name] = value.format(host=host)
                return response

            super().__init__(*args, process_request=process, **options)

    module.serve = GuardedServe  # type: ignore[misc]
    try:
        yield
    finally:
        module.serve = original  # type: ignore[misc]


def _require_gate(server: Any, host: str, port: int) -> None:
    """Knocks without the token, so that a later version of viser that goes around the gate is found out at once."""
    near = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    try:
        connection = http.client.HTTPConnection(near, port, timeout=5.0)
        connection.request("GET", "/")
        status = connection.getresponse().status
        connection.close()
    except OSError as error:
        server.stop()
        raise TeleoperationError(f"the view does not answer on {near}:{port}: {error}") from error
    if status != 403:
        server.stop()
        raise TeleoperationError(
            f"this version of viser answers without the token (status {status}); install one that the "
            "extra 'view' names"
        )


def _forget_sharing(server: Any) -> None:
    """Nobody on the page may ask viser to publish it on the internet."""
    from viser import _messages

    for name in ("ShareUrlRequest", "ShareUrlDisconnect"):
        kind = getattr(_messages, name, None)
        if kind is not None:
            server._websock_server._incoming_handlers.pop(kind, None)
