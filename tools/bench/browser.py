"""A headless Chromium with one page, asked through its DevTools."""

import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self
from urllib.request import Request, urlopen

from websockets.sync.client import ClientConnection, connect

from hil.values.errors import ConfigurationError, EndpointError
from tools.bench.waiting import wait_for

_NAMES: Final = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM: Final = next(filter(None, map(shutil.which, _NAMES)), None)
"""None where there is none."""
_START_S: Final = 20.0
_ANSWER_S: Final = 60.0


class BenchBrowser:
    """Open inside its ``with`` block. ``before`` is a script that runs before those of the page."""

    def __init__(self, address: str, *, before: str = "", width: int = 1280, height: int = 800) -> None:
        if CHROMIUM is None:
            raise ConfigurationError("no Chromium is installed (Debian: apt-get install chromium)")
        self._chromium = CHROMIUM
        self._address, self._before, self._size = address, before, (width, height)
        self._folder = tempfile.TemporaryDirectory(prefix="fri-hil-bench-", ignore_cleanup_errors=True)
        self._process: subprocess.Popen[bytes] | None = None
        self._page: ClientConnection | None = None
        self._number = 0

    def __enter__(self) -> Self:
        profile = Path(self._folder.name)
        self._process = subprocess.Popen(
            [
                self._chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync",
                "--disable-background-networking", "--disable-component-update", "--disable-extensions",
                "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0",
                f"--window-size={self._size[0]},{self._size[1]}", f"--user-data-dir={profile}", "about:blank",
            ],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            port_file = profile / "DevToolsActivePort"
            wait_for(lambda: port_file.is_file() and "\n" in port_file.read_text(), _START_S, "Chromium")
            port = int(port_file.read_text().split()[0])
            self._page = self._open_page(port)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End it; idempotent."""
        page, self._page = self._page, None
        if page is not None:
            page.close()
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._folder.cleanup()

    def run(self, script: str) -> Any:
        """Return the value of an expression, or of what its promise holds; raise :class:`EndpointError`."""
        answer = self._call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise EndpointError(f"the page does not run {script[:60]!r}: {answer['exceptionDetails'].get('text')}")
        return answer["result"].get("value")

    def _open_page(self, port: int) -> ClientConnection:
        with urlopen(Request(f"http://127.0.0.1:{port}/json/new?about:blank", method="PUT"), timeout=_START_S) as told:
            target = json.load(told)
        self._page = connect(target["webSocketDebuggerUrl"], max_size=None)
        self._call("Page.enable")
        if self._before:
            self._call("Page.addScriptToEvaluateOnNewDocument", source=self._before)
        self._call("Page.navigate", url=self._address)
        return self._page

    def _call(self, method: str, **parameters: object) -> dict[str, Any]:
        if self._page is None:
            raise EndpointError("the browser is not open")
        self._number += 1
        self._page.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while (told := json.loads(self._page.recv(timeout=_ANSWER_S))).get("id") != self._number:
            pass
        if "error" in told:
            raise EndpointError(f"Chromium refuses {method}: {told['error'].get('message')}")
        result: dict[str, Any] = told["result"]
        return result
