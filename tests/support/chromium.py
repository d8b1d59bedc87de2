"""Headless Chromium by its DevTools pipe: what becomes of a page when it is opened, and whom it asks for anything."""

import base64
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
from typing import Any, Self

_NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, _NAMES)), None)
NO_CHROMIUM = "no Chromium is installed (Debian: apt-get install chromium)"
_LONGEST_WAIT_S = 45.0
_BY_PIPE = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
os.dup2(ends[0], 3)
os.dup2(ends[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Chromium wants its pipe at the descriptors 3 and 4."""


class Browser:
    """One browser, with a profile of its own in ``folder``. No name resolves in it, so nothing leaves the machine.

    ``reaches`` are loopback addresses that it may ask. WebGL is drawn in software.
    """

    def __init__(self, folder: Path, *, reaches: Sequence[str] = ()) -> None:
        assert CHROMIUM is not None
        rules = ", ".join(["MAP * ~NOTFOUND", *(f"EXCLUDE {host}" for host in reaches)])
        told, self._tell = os.pipe()
        self._hear, heard = os.pipe()
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
        os.close(told)
        os.close(heard)
        self._buffer = b""
        self._number = 0
        self.events: list[dict[str, Any]] = []
        """What happened, of all pages."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):
            os.write(self._tell, b'{"id":0,"method":"Browser.close"}\0')
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._tell)
        os.close(self._hear)

    def open(self, page: Path | str, *, width: int = 1280, height: int = 900, before: str = "") -> "Opened":
        """Open a file or address in a tab of its own, and wait until it is loaded; the script ``before`` runs first."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        opened = Opened(self, session)
        for domain in ("Page", "Runtime", "Log", "Network"):
            opened.call(f"{domain}.enable")
        opened.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        if before:
            opened.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        opened.call("Page.navigate", url=page if isinstance(page, str) else page.as_uri())
        while not any(opened.told("Page.loadEventFired")):
            self.events.append(self._message())
        return opened

    def call(self, method: str, *, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        """Have the browser do something; return its answer."""
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        if session is not None:
            request["sessionId"] = session
        os.write(self._tell, json.dumps(request).encode() + b"\0")
        while (message := self._message()).get("id") != self._number:
            self.events.append(message)
        assert "error" not in message, f"{method}: {message['error']}"
        answer: dict[str, Any] = message["result"]
        return answer

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._hear], [], [], _LONGEST_WAIT_S)
            assert ready, f"Chromium says nothing for {_LONGEST_WAIT_S:g} s"
            said = os.read(self._hear, 1 << 20)
            assert said, "Chromium ended"
            self._buffer += said
        line, self._buffer = self._buffer.split(b"\0", 1)
        message: dict[str, Any] = json.loads(line)
        return message


class Opened:
    """A page in its tab."""

    def __init__(self, browser: Browser, session: str) -> None:
        self._browser = browser
        self._session = session

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
        """Return the value of an expression, or of what its promise holds."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    @property
    def complaints(self) -> list[str]:
        """Errors and warnings of its console, its uncaught errors, and what its policy forbade."""
        spoken = [one for one in self.told("Runtime.consoleAPICalled") if one["type"] in {"error", "warning", "assert"}]
        return [
            *(str(one["args"]) for one in spoken),
            *(str(one["exceptionDetails"]) for one in self.told("Runtime.exceptionThrown")),
            *(one["entry"]["text"] for one in self.told("Log.entryAdded")),
        ]

    @property
    def asked(self) -> list[str]:
        """Addresses that it asked for, but for its own file and what it holds itself."""
        urls = [one["request"]["url"] for one in self.told("Network.requestWillBeSent")]
        return [url for url in urls if not url.startswith(("file:", "data:", "blob:"))]

    def picture(self, file: Path) -> Path:
        """Write what it looks like, all of it."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        file.write_bytes(base64.b64decode(shot["data"]))
        return file
