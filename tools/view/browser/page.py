"""The page: one server for all browsers, a panel for each, and a loop that draws."""

import contextlib
import errno
import io
import socket
import threading
import warnings
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import quote

import viser

from hil.clock import MonotonicClock
from hil.values.errors import EndpointError, HilError
from tools.view.browser.camera import FIELD_OF_VIEW_RAD, camera_for
from tools.view.browser.gate import Gate, Guest
from tools.view.browser.panel import Panel, tell
from tools.view.browser.push import push_by_dragging
from tools.view.browser.renderer import STATION_SCENE, BrowserRenderer
from tools.view.choices import BROWSER
from tools.view.connection import RenderingConnection
from tools.view.drawing import DrawnRobot
from tools.view.operator import Operator
from tools.view.sources import Sources
from tools.view.token import same_token
from tools.view.watch import Watch

FRAMES_PER_S: Final = 30
MAX_BROWSERS: Final = 8
_PANEL_EVERY: Final = 3
"""Drawn frames to one update of the panels."""
_WAITING_ACTIONS: Final = 64
_PORTS_TRIED: Final = 100
_LAST_PORT: Final = 65535
_NS: Final = 1_000_000_000
_NO_FILE: Final = Path("the running controller")
_NOT_SERVED: Final = "the page is not served"
_ORANGE: Final = (230, 90, 0)


class PageOptions(NamedTuple):
    """How the page is served. ``station`` is the file with which choices are kept; ``find`` looks for robots again."""

    token: str
    find: Callable[[], Sources]
    host: str = "127.0.0.1"
    port: int = 8080
    station: Path | None = None


class Page:
    """Serves from ``open`` to ``close``; :meth:`run` draws meanwhile."""

    def __init__(self, watch: Watch, options: PageOptions) -> None:
        self._watch = watch
        self._options = options
        self._served: _Served | None = None
        self._panels: dict[int, Panel] = {}
        self._operators: dict[int, Operator] = {}
        self._waiting: deque[tuple[viser.ClientHandle, Callable[[], object]]] = deque(maxlen=_WAITING_ACTIONS)
        self._lock = threading.RLock()
        self._clock = MonotonicClock()

    def open(self) -> None:
        """Serve the page, and begin the live view; raise :class:`EndpointError` where it cannot be served."""
        # A browser may leave while its panel is made.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
        host, port = self._options.host, self._options.port
        port = first_free_port(host, port)
        with _quiet(), Gate(self._options.token, host).standing():
            server = viser.ViserServer(host=host, port=port, label="fri-hil", verbose=False)
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=_ORANGE)
        camera = camera_for(self._watch.robots)
        server.initial_camera.position, server.initial_camera.look_at = camera
        server.initial_camera.fov = FIELD_OF_VIEW_RAD
        renderer = BrowserRenderer(server, self._watch.sources.objects)
        renderer.started = lambda: push_by_dragging(renderer, self._operators)
        connection = RenderingConnection(renderer, kind=BROWSER, read_station=self._read_station)
        self._served = _Served(server, renderer, connection)
        self._begin(connection)
        server.on_client_connect(self._joined)
        server.on_client_disconnect(self._left)

    @property
    def address(self) -> str:
        """Where the page is, to look at."""
        return f"http://{self._place}"

    @property
    def operator_address(self) -> str:
        """Where it is for the operator: the token is in it."""
        return f"{self.address}/?websocket={quote(f'ws://{self._place}/{self._options.token}', safe=':/')}"

    def run(self, ended: threading.Event) -> None:
        """Draw until ``ended`` is set."""
        connection, due_ns, frames = self._open.connection, self._clock.now_ns(), 0
        while not ended.is_set():
            self._do_what_waits()
            connection.show(self._watch.now())
            frames += 1
            if frames % _PANEL_EVERY == 0:
                for panel in self._all_panels():
                    panel.update()
            # Who was held up does not draw twice as fast afterwards.
            due_ns = max(due_ns + _NS // FRAMES_PER_S, self._clock.now_ns())
            ended.wait((due_ns - self._clock.now_ns()) / _NS)

    def close(self) -> None:
        """Let go of everything held, and serve no more; idempotent."""
        with self._lock:
            panels = list(self._panels.values())
            self._panels.clear()
            self._operators.clear()
        for panel in panels:
            panel.close()
        served, self._served = self._served, None
        if served is not None:
            with _quiet():
                served.server.stop()

    @property
    def _open(self) -> "_Served":
        if self._served is None:
            raise EndpointError(_NOT_SERVED)
        return self._served

    @property
    def _place(self) -> str:
        host = self._options.host
        shown = "127.0.0.1" if host in {"", "0.0.0.0"} else host  # noqa: S104  # compared with
        return f"{shown}:{self._open.server.get_port()}"

    def _read_station(self, _station: Path) -> tuple[DrawnRobot, ...]:
        """The robots are those that run, whatever a file says of them."""
        return self._watch.robots

    def _begin(self, connection: RenderingConnection) -> None:
        connection.select_station(self._options.station or _NO_FILE)
        if not connection.scene:
            connection.select_scene(STATION_SCENE)
        connection.load_scene()
        connection.start_live_view()
        connection.synchronise_frames()

    def _do_what_waits(self) -> None:
        while self._waiting:
            client, action = self._waiting.popleft()
            try:
                action()
            except HilError as refused:
                tell(client, str(refused))

    def _refresh(self) -> None:
        """Look for the robots again, and go on with what is found."""
        self._watch.renew(self._options.find())
        self._open.renderer.surrounded_by(self._watch.sources.objects)
        try:
            self._open.connection.refresh()
        finally:
            # The panels show other robots from now on, whatever is drawn.
            with self._lock:
                clients = self._open.server.get_clients()
                acting = {number: number in self._operators for number in self._panels if number in clients}
            for number, may_act in acting.items():
                self._add_panel(clients[number], may_act=may_act)

    def _all_panels(self) -> list[Panel]:
        with self._lock:
            return list(self._panels.values())

    def _joined(self, client: "viser.ClientHandle") -> None:
        guest = _guest(self._open.server, client.client_id)
        if guest is None:
            return
        with self._lock:
            lookers = sum(number not in self._operators for number in self._panels)
        if lookers >= MAX_BROWSERS and not guest.acts:
            tell(client, f"{MAX_BROWSERS} browsers look already, which is the most; this one has the scene only")
            return
        self._add_panel(client, may_act=guest.acts)

    def _add_panel(self, client: "viser.ClientHandle", *, may_act: bool) -> None:
        operator = None
        if may_act and self._watch.sources.pad is not None:
            operator = Operator(self._watch.sources.pad, lambda text: tell(client, text))
            operator.open()
        served = self._open
        panel = Panel(
            client,
            self._watch,
            served.renderer,
            served.connection,
            operator=operator,
            give_token=lambda given: self._take_token(client, given),
            do=lambda action: self._waiting.append((client, lambda: action(served.connection))),
            refresh=lambda: self._waiting.append((client, self._refresh)),
        )
        with self._lock:
            before = self._panels.get(client.client_id)
            self._panels[client.client_id] = panel
            self._operators.pop(client.client_id, None)
            if operator is not None:
                self._operators[client.client_id] = operator
        if before is not None:
            before.close()
        # Whoever left meanwhile was told goodbye before there was anything to close.
        if client.client_id not in served.server.get_clients():
            self._left(client)

    def _take_token(self, client: "viser.ClientHandle", given: str) -> None:
        if len(given.strip()) < len(self._options.token):
            # It is still being typed.
            return
        guest = _guest(self._open.server, client.client_id)
        if guest is not None and same_token(given, self._options.token):
            guest.acts = True
            self._add_panel(client, may_act=True)
        else:
            tell(client, "that is not the operator's token; hil view printed it")

    def _left(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            panel = self._panels.pop(client.client_id, None)
            self._operators.pop(client.client_id, None)
        if panel is not None:
            panel.close()


class _Served(NamedTuple):
    """What there is while the page is served."""

    server: "viser.ViserServer"
    renderer: BrowserRenderer
    connection: RenderingConnection


def first_free_port(host: str, port: int) -> int:
    """Return ``port``, or the next one that nobody has; raise :class:`EndpointError`.

    viser looks for one itself, and never comes back where there is none.
    """
    candidate = port
    for candidate in range(port, min(port + _PORTS_TRIED, _LAST_PORT + 1)):
        try:
            [(family, kind, _, _, place), *_] = socket.getaddrinfo(
                host or None, candidate, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )
            with socket.socket(family, kind) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(place)
                probe.listen()
        except (OSError, UnicodeError) as error:
            if not isinstance(error, OSError) or error.errno != errno.EADDRINUSE:
                raise EndpointError(
                    f"cannot serve the page at {host}:{candidate}: {getattr(error, 'strerror', '') or error}"
                ) from error
        else:
            return candidate
    raise EndpointError(f"cannot serve the page at {host}: other programs have all ports from {port} to {candidate}")


def _quiet() -> "contextlib.redirect_stdout[io.StringIO]":
    """Keep what viser prints of itself from standard output."""
    return contextlib.redirect_stdout(io.StringIO())


def _guest(server: "viser.ViserServer", client_id: int) -> Guest | None:
    """Return a browser's socket, which viser keeps to itself; None when it left."""
    found: Any = server._websock_server._live_connections.get(client_id)
    return found if isinstance(found, Guest) else None
