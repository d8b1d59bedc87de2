"""The page of ``hil view`` in a browser that is watched: pictures a second, what they cost, what comes to it."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
from tools.bench.processor import processor_s
from tools.view.chromium import Chromium, Tab
from transport.child import module_environment

WIDTH: Final = 1400
HEIGHT: Final = 900
_OPERATORS: Final = re.compile(r"view: (http://\S+) is the operator's")
_START_S: Final = 30.0
_LOOK_S: Final = 0.1
_LOOKS: Final = 300
_WATCHED: Final = """
window.__THREE_DEVTOOLS__ = new EventTarget();
window.hil = {scenes: [], renderers: [], pictures: [], frame: 0, places: 0, hidden: false};
window.__THREE_DEVTOOLS__.addEventListener("observe", event => {
    if (event.detail.isScene) hil.scenes.push(event.detail);
    if (event.detail.isWebGLRenderer) hil.renderers.push(event.detail);
});
hil.look = () => {
    requestAnimationFrame(hil.look);
    const info = hil.renderers.length && hil.renderers[0].info.render;
    if (!info || info.frame === hil.frame) return;
    let places = 0;
    hil.scenes[0].traverse(one => {
        if (!one.isMesh) return;
        for (const part of one.matrixWorld.elements) places += part;
        if (hil.hidden) one.layers.disableAll();
    });
    hil.pictures.push([performance.now(), places !== hil.places, info.calls, info.triangles]);
    [hil.frame, hil.places] = [info.frame, places];
};
requestAnimationFrame(hil.look);
"""
"""three.js tells whoever looks for it of its scenes and renderers. Pictures are noted, and whether anything moved."""
_RENDERER: Final = """(() => {
    const gl = hil.renderers[0].getContext(), told = gl.getExtension("WEBGL_debug_renderer_info");
    return gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
})()"""
_SOFTWARE: Final = re.compile("swiftshader|llvmpipe|software|softpipe", re.IGNORECASE)


class Picture(NamedTuple):
    """One that was drawn; ``moved`` says whether anything stood elsewhere than in the one before."""

    at_ms: float
    moved: bool
    calls: int
    triangles: int


class Watched(NamedTuple):
    """What was seen of a page for ``seconds``."""

    seconds: float
    pictures: tuple[Picture, ...]
    browser_s: dict[str, float]
    """Processor time of the browser by the kind of its processes; ``gpu-process`` draws, ``renderer`` runs the page."""

    def per_second(self, *, moved: bool = False) -> list[int]:
        """Return the pictures of each whole second; with ``moved`` only those in which something moved."""
        counted = [0] * int(self.seconds)
        if self.pictures:
            began_ms = self.pictures[0].at_ms
            for picture in self.pictures:
                second = int((picture.at_ms - began_ms) / 1000.0)
                if second < len(counted) and (picture.moved or not moved):
                    counted[second] += 1
        return counted

    def longest_gap_ms(self) -> float:
        """Return the longest time between two pictures in which something moved."""
        times = [picture.at_ms for picture in self.pictures if picture.moved]
        return max((after - before for before, after in pairwise(times)), default=0.0)


class WatchedPage:
    """The page in a headless browser, from :func:`open_page`."""

    def __init__(self, browser: Chromium, tab: Tab) -> None:
        self._browser = browser
        self._tab = tab

    @property
    def renderer(self) -> str:
        """What draws, as WebGL calls it."""
        return str(self._tab.run(_RENDERER))

    @property
    def pixel_ratio(self) -> float:
        """Drawn pixels to one of the window: viser draws fewer where it does not get along."""
        return float(self._tab.run("hil.renderers[0].getPixelRatio()"))

    @property
    def version(self) -> str:
        """Of the browser."""
        return str(self._browser.call("Browser.getVersion")["product"])

    def wait_until_drawn(self, meshes: int) -> None:
        """Wait until so many meshes are there; raise :class:`EndpointError` when they do not come."""
        count = "(() => { let found = 0; hil.scenes[0]?.traverse(one => found += !!one.isMesh); return found; })()"
        for _ in range(_LOOKS):
            if int(self._tab.run(count)) >= meshes:
                return
            self.let_pass(_LOOK_S)
        raise EndpointError(f"the page did not draw {meshes} meshes within {_LOOKS * _LOOK_S:g} s")

    def let_pass(self, seconds: float) -> None:
        """Let the page's time pass."""
        self._tab.run(f"new Promise(done => setTimeout(done, {1000.0 * seconds}))")

    def draw_nothing(self) -> None:
        """Leave all meshes out of the pictures from now on; everything else goes on, as for a browser with a GPU."""
        self._tab.run("hil.hidden = true, 0")
        self.let_pass(1.0)

    def watch(self, seconds: float) -> Watched:
        """Let it draw for so long, and return what it drew."""
        self._tab.run("hil.pictures.length = 0")
        used_before, began_ns = processor_s(self._browser.process_id), elapsed_ns()
        self.let_pass(seconds)
        pictures: list[list[Any]] = self._tab.run("hil.pictures")
        took_s = (elapsed_ns() - began_ns) * 1e-9
        used = processor_s(self._browser.process_id)
        return Watched(
            took_s,
            tuple(Picture(*picture) for picture in pictures),
            {kind: used_s - used_before.get(kind, 0.0) for kind, used_s in used.items()},
        )

    def bytes_a_second(self, seconds: float) -> float:
        """Listen to the socket of the page for so long. The listening costs the browser time: not while it is timed."""
        self._tab.call("Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=False, flatten=True)
        self._tab.call("Runtime.evaluate", expression="0")
        workers = [
            Tab(self._browser, event["sessionId"])
            for event in self._tab.told("Target.attachedToTarget")
            if event["targetInfo"]["type"] == "worker"
        ]
        for worker in workers:
            worker.call("Network.enable")
        self.let_pass(seconds)
        for worker in workers:
            worker.call("Network.disable")
        said = [one["response"] for worker in workers for one in worker.told("Network.webSocketFrameReceived")]
        return sum(_payload_bytes(one) for one in said) / seconds


def _payload_bytes(frame: dict[str, Any]) -> int:
    told = str(frame["payloadData"])
    # A text frame is told as it is, all others in base64.
    return len(told.encode()) if frame["opcode"] == 1 else 3 * len(told) // 4


def is_software(renderer: str) -> bool:
    """Return whether a renderer of that name draws with the processor."""
    return _SOFTWARE.search(renderer) is not None


@contextmanager
def open_page(address: str, *, reaches: str) -> Iterator[WatchedPage]:
    """Open the page in a browser of its own, until the context ends."""
    with (
        tempfile.TemporaryDirectory(prefix="fri-hil-browser-", ignore_cleanup_errors=True) as folder,
        Chromium(Path(folder), reaches=[reaches]) as browser,
    ):
        tab = browser.new_tab(("Page", "Runtime"), width=WIDTH, height=HEIGHT, before=_WATCHED)
        tab.go(address)
        yield WatchedPage(browser, tab)


@contextmanager
def controller_with_words(said: Path, *arguments: object) -> "Iterator[subprocess.Popen[bytes]]":
    """Run ``hil run`` until the context ends; what it says of itself goes to the file ``said``."""
    with said.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli.main", "run", *map(str, arguments)],
            env=module_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=output,
        )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


def wait_for_page(process: "subprocess.Popen[bytes]", said: Path) -> str:
    """Return the operator's address of a process that writes what it says to a file."""
    for _ in range(round(_START_S / _LOOK_S)):
        found = _OPERATORS.search(said.read_text(encoding="utf-8", errors="replace"))
        if found:
            return found[1]
        try:
            process.wait(_LOOK_S)
        except subprocess.TimeoutExpired:
            continue
        break
    told = said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    raise EndpointError(f"hil run showed no page within {_START_S:g} s: {told[-1] if told else 'it said nothing'}")
