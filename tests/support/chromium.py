"""A page in headless Chromium, as tests see it: what becomes of it when it is opened, and whom it asks for anything."""

import base64
from pathlib import Path

from tools.view.chromium import CHROMIUM, NO_CHROMIUM, Chromium, Tab

__all__ = ["CHROMIUM", "NO_CHROMIUM", "Browser", "Opened"]


class Browser(Chromium):
    """The browser, which opens pages to be looked at."""

    def open(self, page: Path | str, *, width: int = 1280, height: int = 900, before: str = "") -> "Opened":
        """Open a file or address in a tab of its own, and wait until it is loaded; the script ``before`` runs first."""
        tab = self.new_tab(("Page", "Runtime", "Log", "Network"), width=width, height=height, before=before)
        tab.go(page if isinstance(page, str) else page.as_uri())
        return Opened(tab)


class Opened:
    """A page in its tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self.call, self.told, self.run = tab.call, tab.told, tab.run

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

    def picture(self, file: Path, *, whole: bool = True) -> Path:
        """Write what it looks like: all of it, for which it is laid out anew, or what is in the window."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        file.write_bytes(base64.b64decode(shot["data"]))
        return file
