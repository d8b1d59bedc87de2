"""Headless Chromium by its DevTools pipe: opens a page, and asks it things."""

import json
import os
import select
import shutil
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from hil.values.errors import EndpointError

_NAMES: Final = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM: Final = next(filter(None, map(shutil.which, _NAMES)), None)
NO_CHROMIUM: Final = "no Chromium is installed (Debian: apt-get install chromium)"
MAX_EVENTS: Final = 100_000
_LONGEST_WAIT_S: Final = 45.0
_CLOSING_S: Final = 10.0
_BY_PIPE: Final = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
os.dup2(ends[0], 3)
os.dup2(ends[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Chromium wants its pipe at the descriptors 3 and 4."""


class Chromium:
    """One browser, with a profile of its own in ``folder``. No name resolves in it, so nothing leaves the machine.

    ``reaches`` are loopback addresses that it may ask. WebGL is drawn in software. Everything raises
    :class:`EndpointError` when there is no Chromium, when it ends, and when it says nothing for long.
    """

    def __init__(self, folder: Path, *, reaches: Sequence[str] = ()) -> None:
        if CHROMIUM is None:
            raise EndpointError(NO_CHROMIUM)
        rules = ", ".join(["MAP * ~NOTFOUND", *(f"EXCLUDE {host}" for host in reaches)])
        told, self._tell = os.pipe()
        self._hear, heard = os.pipe()
        try:
            self._process = subprocess.Popen(
                [
                    sys.executable, "-c", _BY_PIPE, str(told), str(heard), CHROMIUM,
                    "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
                    "--disable-background-networking", "--disable-component-update", "--disable-sync",
                    "--disable-extensions", f"--host-resolver-rules={rules}", "--remote-debugging-pipe",
                    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
                    f"--user-data-dir={folder / 'profile'}", "about:blank",
                ],
                pass_fds=(told, heard), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        except OSError as error:
            os.close(self._tell)
            os.close(self._hear)
            raise EndpointError(f"Chromium cannot be started: {error.strerror or error}") from error
        finally:
            os.close(told)
            os.close(heard)
        self._buffer = b""
        self._number = 0
        self.events: list[dict[str, Any]] = []
        """What happened, of all pages; :data:`MAX_EVENTS` are the most that are taken."""

    @property
    def process_id(self) -> int:
        """Of the browser; its other processes are children of that one."""
        return self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):
            os.write(self._tell, b'{"id":0,"method":"Browser.close"}\0')
        try:
            self._process.wait(_CLOSING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._tell)
        os.close(self._hear)

    def new_tab(self, domains: Sequence[str], *, width: int, height: int, before: str = "") -> "Tab":
        """Return an empty tab that tells of ``domains``; in what it loads, the script ``before`` runs first."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        tab = Tab(self, self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"])
        for domain in domains:
            tab.call(f"{domain}.enable")
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        if before:
            tab.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        return tab

    def call(self, method: str, *, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        """Have the browser do something; return its answer."""
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        if session is not None:
            request["sessionId"] = session
        try:
            os.write(self._tell, json.dumps(request).encode() + b"\0")
        except OSError as error:
            raise EndpointError(f"Chromium ended before {method}: {error.strerror}") from error
        while (message := self._message()).get("id") != self._number:
            self._note(message)
        if "error" in message:
            raise EndpointError(f"Chromium refuses {method}: {message['error']}")
        answer: dict[str, Any] = message["result"]
        return answer

    def hear(self) -> None:
        """Wait for something to happen, and note it."""
        self._note(self._message())

    def _note(self, event: dict[str, Any]) -> None:
        if len(self.events) >= MAX_EVENTS:
            raise EndpointError(f"more than {MAX_EVENTS} things happened in Chromium, which is more than we take")
        self.events.append(event)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._hear], [], [], _LONGEST_WAIT_S)
            if not ready:
                raise EndpointError(f"Chromium says nothing for {_LONGEST_WAIT_S:g} s")
            said = os.read(self._hear, 1 << 20)
            if not said:
                raise EndpointError("Chromium ended")
            self._buffer += said
        line, self._buffer = self._buffer.split(b"\0", 1)
        message: dict[str, Any] = json.loads(line)
        return message


class Tab:
    """A tab of the browser."""

    def __init__(self, browser: Chromium, session: str) -> None:
        self._browser = browser
        self._session = session

    def go(self, address: str) -> None:
        """Load a page, and wait until it is loaded; the domain ``Page`` must be told of."""
        self.call("Page.navigate", url=address)
        while not self.told("Page.loadEventFired"):
            self._browser.hear()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Have the tab do something."""
        return self._browser.call(method, session=self._session, **parameters)

    def told(self, method: str) -> list[dict[str, Any]]:
        """What happened in the tab, of one kind."""
        return [
            event["params"]
            for event in self._browser.events
            if event.get("sessionId") == self._session and event.get("method") == method
        ]

    def run(self, script: str) -> Any:
        """Return the value of an expression, or of what its promise holds; raise what it raised as words."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise EndpointError(f"the page in Chromium failed: {answer['exceptionDetails']}")
        return answer["result"].get("value")
