"""PageProcess: a page in a process of its own; whoever shows something there never waits for it."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import secrets
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from syda_gym.errors import MissingExtraError, TeleoperationError
from syda_gym.simulation.page.plan import PagePlan

__all__ = ["PageProcess"]

_START = 180.0  # s; a busy machine takes long to import and to read meshes


class PageProcess:
    """Starts the page, sends it what to show, and passes on what is pressed there.

    A thread asks ``look`` for what to show as often as ``rate`` says, and only when the page has shown what came
    before: a slow browser, or none, costs pictures and nothing else, and the newest always wins.

    Args:
        plan: what stands on the page.
        look: called in a thread of this class; returns a message of ``poses``, ``text``, ``picture``, ``time`` and
            ``values``, each optional, or ``None`` for nothing new.
        on_press: called with a button's name, in another thread.
        on_choice: called with what was chosen, in that thread.
        host: address to listen on.
        port: 0 for any that is free.
        token: that opens the page; a new one if not given.
        rate: of messages [Hz].

    Attributes:
        address: to open in a browser, with the token; empty before ``open``.
    """

    def __init__(
        self,
        plan: PagePlan,
        look: Callable[[], dict[str, Any] | None],
        *,
        on_press: Callable[[str], None] = lambda name: None,
        on_choice: Callable[[str], None] = lambda name: None,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        rate: float = 20.0,
    ) -> None:
        self.plan = plan
        self.address = ""
        self._look = look
        self._on_press, self._on_choice = on_press, on_choice
        self._host, self._port = host, port
        self._token = token or secrets.token_urlsafe(24)
        self._period = 1.0 / rate
        self._child: subprocess.Popen[str] | None = None
        self._ending = threading.Event()
        self._shown = threading.Event()
        self._first: dict[str, Any] = {}
        self._answered = threading.Event()
        self._threads: list[threading.Thread] = []

    def open(self) -> None:
        """Starts the page and waits until it can be opened.

        Raises:
            MissingExtraError: viser is not installed.
            TeleoperationError: it cannot be shown; the message says why.
        """
        if importlib.util.find_spec("viser") is None:
            raise MissingExtraError("the view", "view")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._child = subprocess.Popen(
            [sys.executable, "-m", "syda_gym.simulation.page.child"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8", env=environment,
        )  # fmt: skip
        hello = {"plan": self.plan.to_json(), "host": self._host, "port": self._port, "token": self._token}
        self._send(hello)
        self._start("page answers", self._listen)
        if not self._answered.wait(_START) or "ready" not in self._first:
            why = self._first.get("error", "it did not start; see above")
            self.close()
            raise TeleoperationError(f"the view cannot be shown: {why}")
        self.address = str(self._first["ready"])
        self._shown.set()
        self._start("page", self._show)

    @property
    def alive(self) -> bool:
        """Whether the page can still be opened."""
        return self._child is not None and self._child.poll() is None

    def close(self) -> None:
        """Ends the page; harmless when repeated."""
        self._ending.set()
        self._shown.set()
        child, self._child = self._child, None
        if child is None:
            return
        with contextlib.suppress(OSError):
            if child.stdin is not None:
                child.stdin.close()
        try:
            child.wait(timeout=3.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=2.0)
        if child.stdout is not None:
            child.stdout.close()

    def __enter__(self) -> PageProcess:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self, name: str, target: Callable[[], None]) -> None:
        thread = threading.Thread(target=target, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _show(self) -> None:
        while not self._ending.is_set():
            begun = time.monotonic()
            self._shown.wait()
            if self._ending.is_set():
                return
            message = self._look()
            if message is not None:
                self._shown.clear()
                if not self._send(message):
                    return
            self._ending.wait(max(0.0, self._period - (time.monotonic() - begun)))

    def _send(self, message: dict[str, Any]) -> bool:
        child = self._child
        if child is None or child.stdin is None:
            return False
        try:
            child.stdin.write(json.dumps(message) + "\n")
            child.stdin.flush()
        except (OSError, ValueError):  # the page is gone; what it showed goes on without it
            return False
        return True

    def _listen(self) -> None:
        child = self._child
        if child is None or child.stdout is None:
            return
        with contextlib.suppress(OSError, ValueError):
            for line in child.stdout:
                message = json.loads(line)
                if not self._answered.is_set():
                    self._first = message
                    self._answered.set()
                elif "shown" in message:
                    self._shown.set()
                elif "pressed" in message:
                    self._on_press(str(message["pressed"]))
                elif "chosen" in message:
                    self._on_choice(str(message["chosen"]))
        self._answered.set()
        self._shown.set()
