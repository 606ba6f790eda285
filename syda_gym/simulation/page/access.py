"""Gate: who may open the page and press its buttons; a page of a stranger's may not."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

__all__ = ["HEADERS", "Answer", "Gate"]

HEADERS = {
    # Whatever the page's program wants, the browser speaks to this server alone and shows it in no other page's frame.
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "connect-src 'self' blob: data: ws://{host}; frame-ancestors 'none'; form-action 'none'; base-uri 'none'",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Sent with the page; ``{host}`` stands for the address that the browser asked for."""


class Answer(NamedTuple):
    """What to say instead of the page."""

    status: int
    text: str
    headers: dict[str, str]


class Gate:
    """Lets in whoever knows the token, from the page itself and under an expected name.

    The address that is printed carries the token; it is exchanged for a cookie that scripts cannot read and that
    browsers send from no other site. A WebSocket is opened to pages of this very server alone: its ``Origin`` must be
    the address it was asked under, and that must be a name of this machine where the page listens on loopback, so that
    a stranger's domain that suddenly points here is of no use.

    Args:
        host: address that the page listens on.
        token: the secret.
    """

    def __init__(self, host: str, token: str) -> None:
        self._token = token
        self._local = _is_loopback(host)

    def cookie(self, port: int | None) -> str:
        """Name of the cookie; of each port its own, because browsers share cookies between ports."""
        return f"syda_gym_{port or 80}"

    def answer(self, path: str, headers: Mapping[str, str]) -> Answer | None:
        """Decides on a request.

        Args:
            path: as asked for, with what follows the question mark.
            headers: of the request; names in any case.

        Returns:
            ``None`` to let it pass, else what to answer.
        """
        given = {name.lower(): value for name, value in headers.items()}
        host = given.get("host", "")
        try:
            address = urlsplit(f"//{host}")
            port = address.port
        except ValueError:
            return _refusal("an address that is none")
        if not address.hostname or (self._local and not _is_loopback(address.hostname)):
            return _refusal("this page is asked for by its own address only")
        socket = given.get("upgrade", "").lower() == "websocket"
        origin = given.get("origin")
        if (socket or origin is not None) and origin not in (f"http://{host}", f"https://{host}"):
            return _refusal("another page may not speak to this one")
        if self._equal(_cookie(given.get("cookie", ""), self.cookie(port))):
            return None
        asked = parse_qs(urlsplit(path).query).get("token", [""])[0]
        if not socket and self._equal(asked):
            return Answer(
                303, "", {
                    "Location": "/",
                    "Set-Cookie": f"{self.cookie(port)}={self._token}; HttpOnly; SameSite=Strict; Path=/",
                },
            )  # fmt: skip
        return _refusal("open the address that the terminal shows, with its token")

    def _equal(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _refusal(words: str) -> Answer:
    return Answer(403, f"403: {words}\n", {})


def _cookie(text: str, name: str) -> str:
    try:
        found = SimpleCookie(text).get(name)
    except CookieError:
        return ""
    return found.value if found is not None else ""


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
