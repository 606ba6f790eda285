"""Who may open the page: whoever knows the token, from the page itself, under a name of this machine."""

from __future__ import annotations

import pytest

from syda_gym.simulation.page.access import Gate

TOKEN = "a-secret-of-some-length"
HOST = "127.0.0.1:8099"
COOKIE = f"syda_gym_8099={TOKEN}"


def asks(path: str = "/", **headers: str) -> int:
    """The status that a request gets; 200 stands for being let through."""
    given = {"Host": HOST, **{name.replace("_", "-"): value for name, value in headers.items()}}
    answer = Gate("127.0.0.1", TOKEN).answer(path, given)
    return 200 if answer is None else answer.status


def test_the_printed_address_is_exchanged_for_a_cookie_that_scripts_and_other_sites_cannot_use() -> None:
    answer = Gate("127.0.0.1", TOKEN).answer(f"/?token={TOKEN}", {"Host": HOST})
    assert answer is not None
    assert answer.status == 303
    assert answer.headers["Location"] == "/"
    cookie = answer.headers["Set-Cookie"]
    assert cookie.startswith(COOKIE)
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie


def test_with_the_cookie_the_page_and_its_socket_open() -> None:
    assert asks(Cookie=COOKIE) == 200
    assert asks(Cookie=f"other=1; {COOKIE}", Upgrade="websocket", Origin=f"http://{HOST}") == 200


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Cookie": "syda_gym_8099=wrong"},
        {"Cookie": f"syda_gym_8100={TOKEN}"},
        {"Cookie": "=;=\x00"},
        {"Upgrade": "websocket", "Origin": f"http://{HOST}"},
    ],
)
def test_without_the_token_nothing_opens(headers: dict[str, str]) -> None:
    assert asks(**headers) == 403
    assert asks("/?token=wrong", **headers) == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:9999", "null", f"http://{HOST}.evil.example"]
)
def test_a_page_of_somebody_else_cannot_steer_even_with_the_cookie(origin: str) -> None:
    assert asks(Upgrade="websocket", Origin=origin, Cookie=COOKIE) == 403
    assert asks(f"/?token={TOKEN}", Upgrade="websocket", Origin=origin) == 403


def test_a_socket_without_an_origin_is_refused() -> None:
    assert asks(Upgrade="websocket", Cookie=COOKIE) == 403


@pytest.mark.parametrize("host", ["evil.example:8099", "192.168.1.4:8099", "", "[::1", "127.0.0.1:port"])
def test_a_name_that_is_not_this_machines_is_refused(host: str) -> None:
    """Somebody's domain may point at 127.0.0.1 all of a sudden."""
    answer = Gate("127.0.0.1", TOKEN).answer("/", {"Host": host, "Cookie": COOKIE})
    assert answer is not None
    assert answer.status == 403


def test_beyond_this_machine_any_name_will_do_with_the_token() -> None:
    gate = Gate("0.0.0.0", TOKEN)
    assert gate.answer("/", {"Host": "robot.lab:8099", "Cookie": COOKIE}) is None
    refused = gate.answer("/", {"Host": "robot.lab:8099"})
    assert refused is not None
    assert refused.status == 403
