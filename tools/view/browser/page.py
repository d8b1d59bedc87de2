"""The page: one server for all browsers, a panel for each, and a loop that draws."""

import contextlib
import io
import math
import threading
from typing import Final
from urllib.parse import quote

import viser

from hil.clock import MonotonicClock
from hil.values.errors import EndpointError
from tools.view.browser.panel import Panel, tell
from tools.view.browser.push import push_by_dragging
from tools.view.browser.renderer import STATION_SCENE, BrowserRenderer
from tools.view.operator import Operator
from tools.view.token import same_token
from tools.view.watch import Watch

FRAMES_PER_S: Final = 30
_PANEL_EVERY: Final = 3
"""Drawn frames to one update of the panels."""
MAX_BROWSERS: Final = 8
_NS: Final = 1_000_000_000
_NOT_SERVED: Final = "the page is not served"


class Page:
    """Serves from ``open`` to ``close``; :meth:`run` draws meanwhile."""

    def __init__(self, watch: Watch, *, host: str, port: int, token: str) -> None:
        self._watch = watch
        self._host, self._port = host, port
        self._token = token
        self._server: viser.ViserServer | None = None
        self._renderer: BrowserRenderer | None = None
        self._panels: dict[int, Panel] = {}
        self._operators: dict[int, Operator] = {}
        self._lock = threading.Lock()
        self._clock = MonotonicClock()

    def open(self) -> None:
        """Serve the page; raise :class:`EndpointError` where that cannot be."""
        try:
            with _quiet():
                server = viser.ViserServer(host=self._host, port=self._port, label="fri-hil", verbose=False)
        except OSError as error:
            raise EndpointError(f"cannot serve the page at {self._host}:{self._port}: {error.strerror}") from error
        self._server = server
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(230, 90, 0))
        server.initial_camera.position = (1.75, -1.55, 1.3)
        server.initial_camera.fov = math.radians(45.0)
        server.initial_camera.look_at = (0.0, 0.0, 0.5)
        renderer = self._renderer = BrowserRenderer(server, self._watch.sources.objects)
        renderer.load_scene(STATION_SCENE, self._watch.robots)
        renderer.start({name: name for name in renderer.devices()})
        renderer.synchronise_frames()
        push_by_dragging(renderer, self._operators)
        server.on_client_connect(self._joined)
        server.on_client_disconnect(self._left)

    @property
    def address(self) -> str:
        """Where the page is, to look at."""
        return f"http://{self._shown_host}:{self._opened.get_port()}"

    @property
    def operator_address(self) -> str:
        """Where it is for the operator: the token is in it."""
        socket = f"ws://{self._shown_host}:{self._opened.get_port()}/{self._token}"
        return f"{self.address}/?websocket={quote(socket, safe=':/')}"

    def run(self, ended: threading.Event) -> None:
        """Draw until ``ended`` is set."""
        renderer, due_ns, frames = self._drawing, self._clock.now_ns(), 0
        while not ended.is_set():
            renderer.show(self._watch.now())
            frames += 1
            if frames % _PANEL_EVERY == 0:
                with self._lock:
                    panels = list(self._panels.values())
                for panel in panels:
                    panel.update()
            # Who was held up does not draw twice as fast afterwards.
            due_ns = max(due_ns + _NS // FRAMES_PER_S, self._clock.now_ns())
            ended.wait(max(0, due_ns - self._clock.now_ns()) / _NS)

    def close(self) -> None:
        """Let go of everything held, and serve no more; idempotent."""
        with self._lock:
            panels = list(self._panels.values())
            self._panels.clear()
            self._operators.clear()
        for panel in panels:
            panel.close()
        server, self._server = self._server, None
        if server is not None:
            with _quiet():
                server.stop()

    @property
    def _opened(self) -> "viser.ViserServer":
        if self._server is None:
            raise EndpointError(_NOT_SERVED)
        return self._server

    @property
    def _shown_host(self) -> str:
        return "127.0.0.1" if self._host in {"", "0.0.0.0"} else self._host  # noqa: S104  # compared with

    def _joined(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            if len(self._panels) >= MAX_BROWSERS:
                tell(client, f"{MAX_BROWSERS} browsers have the pad, which is the most; this one has the scene only")
                return
        self._add_panel(client, same_token(_path_of(self._opened, client.client_id).strip("/"), self._token))

    def _add_panel(self, client: "viser.ClientHandle", may_act: bool) -> None:
        operator = None
        if may_act and self._watch.sources.pad is not None:
            operator = Operator(self._watch.sources.pad, lambda text: tell(client, text))
            operator.open()
        panel = Panel(
            client,
            self._watch,
            self._drawing,
            operator=operator,
            give_token=lambda given: self._take_token(client, given),
        )
        with self._lock:
            before = self._panels.get(client.client_id)
            self._panels[client.client_id] = panel
            if operator is not None:
                self._operators[client.client_id] = operator
        if before is not None:
            before.close()

    @property
    def _drawing(self) -> BrowserRenderer:
        if self._renderer is None:
            raise EndpointError(_NOT_SERVED)
        return self._renderer

    def _take_token(self, client: "viser.ClientHandle", given: str) -> None:
        if not given:
            return
        if same_token(given, self._token):
            self._add_panel(client, may_act=True)
        else:
            tell(client, "that is not the operator's token; hil view printed it")

    def _left(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            panel = self._panels.pop(client.client_id, None)
            self._operators.pop(client.client_id, None)
        if panel is not None:
            panel.close()


def _quiet() -> "contextlib.redirect_stdout[io.StringIO]":
    """Keep what viser prints of itself from standard output."""
    return contextlib.redirect_stdout(io.StringIO())


def _path_of(server: "viser.ViserServer", client_id: int) -> str:
    """Return the path of the address a browser's socket asked for, which viser keeps to itself."""
    connection = server._websock_server._live_connections.get(client_id)
    request = None if connection is None else connection.request
    return "" if request is None else request.path
