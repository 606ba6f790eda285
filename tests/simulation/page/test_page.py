"""The page's process: it is reached with its token alone, shows the newest, tells what is pressed, and never delays."""

from __future__ import annotations

import http.client
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from syda_gym.embodiments import catalog
from syda_gym.errors import TeleoperationError
from syda_gym.look import REFERENCE, rgba
from syda_gym.simulation.page.plan import Button, PagePlan, PlotPlan, body_plan
from syda_gym.simulation.page.process import PageProcess

pytest.importorskip("viser", reason="SKIPPED LOUDLY: the extra 'view' is not installed")
PEPPER, ADULT = catalog.get("pepper"), catalog.get("adult")


def plan(**changes: object) -> PagePlan:
    values = {
        "title": "test",
        "bodies": (
            body_plan(PEPPER, "robot"),
            body_plan(PEPPER, "ghost", colour=rgba(REFERENCE, 0.4)),
            body_plan(ADULT, "operator", place=(0.0, 0.95, 0.0)),
        ),
        "buttons": (Button("stop", "Stop"),),
        "plots": (PlotPlan("bound", (("bound", REFERENCE),)),),
    }
    return PagePlan(**{**values, **changes})  # type: ignore[arg-type]


class Looks:
    """Counts how often the page asked, and gives poses that move."""

    def __init__(self, *, bodies: bool = True) -> None:
        self.count = 0
        self.bodies = bodies

    def __call__(self) -> dict[str, object]:
        self.count += 1
        angles = (PEPPER.rest + 0.01 * (self.count % 30)).tolist()
        poses = {"robot": angles, "ghost": angles, "operator": ADULT.standing().tolist()} if self.bodies else {}
        return {"poses": poses, "time": 0.1 * self.count, "values": [[0.1]], "text": "**following**"}


@pytest.fixture(scope="module")
def looks() -> Looks:
    return Looks()


@pytest.fixture(scope="module")
def page(looks: Looks) -> Iterator[PageProcess]:
    with PageProcess(plan(), looks, token="a-token-for-the-test") as opened:
        yield opened


def wait_until(true: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def get(page: PageProcess, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    address = urlsplit(page.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=120.0)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    response = connection.getresponse()
    result = response.status, {name.lower(): value for name, value in response.getheaders()}, response.read()
    connection.close()
    return result


def test_the_page_listens_on_loopback_and_tells_its_address(page: PageProcess) -> None:
    assert page.address.startswith("http://127.0.0.1:")
    assert page.address.endswith("/?token=a-token-for-the-test")
    assert page.alive


def test_without_the_token_there_is_no_page(page: PageProcess) -> None:
    status, _, body = get(page, "/")
    assert status == 403
    assert b"token" in body


def test_with_the_token_the_page_comes_and_may_speak_to_nobody_else(page: PageProcess) -> None:
    status, headers, _ = get(page, "/?token=a-token-for-the-test")
    assert status == 303
    status, headers, body = get(page, "/", Cookie=headers["set-cookie"].split(";")[0])
    assert status == 200
    assert b"<html" in body.lower()
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "http:" not in policy
    assert "https:" not in policy
    assert "frame-ancestors 'none'" in policy


def test_a_strangers_page_cannot_open_the_socket(page: PageProcess) -> None:
    address = urlsplit(page.address)
    cookie = f"syda_gym_{address.port}=a-token-for-the-test"
    for origin, expected in (("http://evil.example", 403), (f"http://127.0.0.1:{address.port}", 101)):
        with socket.create_connection((str(address.hostname), int(address.port or 0)), timeout=120.0) as link:
            link.sendall(
                (
                    f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{address.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                    f"Origin: {origin}\r\nCookie: {cookie}\r\n\r\n"
                ).encode()
            )
            assert int(link.recv(64).split()[1]) == expected


def test_the_page_asks_for_what_is_new_again_and_again(page: PageProcess, looks: Looks) -> None:
    before = looks.count
    wait_until(lambda: looks.count > before + 3)


def test_a_page_that_is_busy_is_asked_nothing_and_the_asker_waits_in_its_own_thread() -> None:
    """Stopped in the middle of what it does, the page takes no messages; nothing is piled up for it."""
    import os
    import signal

    count = Looks(bodies=False)
    with PageProcess(plan(bodies=()), count, rate=50.0) as opened:
        wait_until(lambda: count.count > 3)
        assert opened._child is not None
        os.kill(opened._child.pid, signal.SIGSTOP)
        try:
            time.sleep(0.3)
            asked = count.count
            time.sleep(0.5)
            assert count.count <= asked + 1
        finally:
            os.kill(opened._child.pid, signal.SIGCONT)
        wait_until(lambda: count.count > asked + 3)


def test_a_page_that_died_ends_nothing_else() -> None:
    count = Looks(bodies=False)
    with PageProcess(plan(bodies=()), count) as opened:
        assert opened._child is not None
        opened._child.kill()
        wait_until(lambda: not opened.alive)
        time.sleep(0.5)
        asked = count.count
        time.sleep(0.5)
        assert count.count == asked, "nobody is asked for what nobody sees"


class TestBadInput:
    def test_a_taken_port_is_one_clear_error(self, page: PageProcess) -> None:
        port = int(urlsplit(page.address).port or 0)
        with pytest.raises(TeleoperationError, match=f"cannot listen on 127.0.0.1:{port}"):
            PageProcess(plan(bodies=()), Looks(), port=port).open()

    def test_a_urdf_that_is_none_is_one_clear_error(self, tmp_path: Path) -> None:
        wrong = tmp_path / "wrong.urdf"
        wrong.write_text("<robot name='x'><link")
        bodies = (body_plan(PEPPER, "robot", appearance=wrong),)
        with pytest.raises(TeleoperationError, match=r"the view cannot show .*wrong\.urdf"):
            PageProcess(plan(bodies=bodies), Looks()).open()

    def test_a_urdf_of_another_robot_is_one_clear_error(self, tmp_path: Path) -> None:
        other = tmp_path / "other.urdf"
        box = "<visual><geometry><box size='0.1 0.1 0.1'/></geometry></visual>"
        other.write_text(
            f"<robot name='o'><link name='a'>{box}</link><link name='b'>{box}</link><joint name='j' type='revolute'>"
            "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/><limit lower='-1' upper='1'"
            " effort='1' velocity='1'/>"
            "</joint></robot>"
        )
        bodies = (body_plan(PEPPER, "robot", appearance=other),)
        with pytest.raises(TeleoperationError, match="no movable joint 'LShoulderPitch'"):
            PageProcess(plan(bodies=bodies), Looks()).open()

    def test_no_urdf_is_one_clear_error(self, tmp_path: Path) -> None:
        bodies = (body_plan(PEPPER, "robot", appearance=tmp_path / "absent.urdf"),)
        with pytest.raises(TeleoperationError, match="no URDF"):
            PageProcess(plan(bodies=bodies), Looks()).open()


def test_a_plan_travels_as_json() -> None:
    import json

    sent = plan(choices=("clip", ("a", "b")))
    assert PagePlan.from_json(json.loads(json.dumps(sent.to_json()))) == sent


def test_every_angle_of_the_robot_stands_where_bullet_puts_it() -> None:
    """The page's robot, drawn link by link, is the robot: its wrists lie where the landmarks are."""
    from unittest.mock import MagicMock

    from syda_gym.simulation.page.drawing import RobotDrawing

    drawn = RobotDrawing(MagicMock(), body_plan(PEPPER, "robot"))
    angles = np.random.default_rng(0).uniform(PEPPER.lower, PEPPER.upper)
    drawn.pose(angles.tolist())
    points = PEPPER.arm_points(angles)[0]
    for arm, side in zip(PEPPER.description.arms, range(len(points)), strict=True):
        place = drawn._root @ drawn._transform(arm.elbow)
        np.testing.assert_allclose(place[:3, 3], points[side, 1], atol=2e-3)
