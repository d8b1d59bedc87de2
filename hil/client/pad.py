"""The operator's pad of a running controller, from a program: blocking, over the controller's Unix socket.

::

    from hil.client.pad import PadClient

    with PadClient() as pad:
        pad.select_mode("T1")
        pad.enable(hold=True)
        pad.start()
        print(pad.status()["arm"]["program"])

Each line on the socket is a JSON object: a request (``{"do": "mode", "mode": "T1", "robot": "arm", "id": 7}``) is
answered by one with the same ``id``. After ``{"do": "watch"}`` states come by themselves.
"""

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, NotRequired, Self, TypedDict

from hil.client.pad_folder import checked_socket_path, distrusted, listens, process_of, socket_folder
from hil.values.arm import DEFAULT_PUSH_S
from hil.values.errors import EndpointError, HilError
from hil.values.operator import PadKey
from hil.values.robot import JOINT_COUNT

_MAX_LINE_BYTES: Final = 1 << 20
_LIST_TIMEOUT_S: Final = 1.0


class PadRefused(HilError):
    """The controller did not do it, and says why; ``robots`` is its state where it told it."""

    def __init__(self, reason: str, robots: "dict[str, RobotState]") -> None:
        self.robots = robots
        super().__init__(reason)


class SessionInfo(TypedDict):
    """FRI session of a robot."""

    state: str
    quality: str


class StopInfo(TypedDict):
    """A stop of the arm; ``category`` is None for the end of a motion that is no safety stop."""

    at_s: float
    category: int | None
    reason: str


class SignalInfo(TypedDict):
    """An input or output; ``type`` is boolean, digital or analog, ``direction`` input or output."""

    type: str
    direction: str
    value: bool | int | float
    fri: bool


class MarginInfo(TypedDict):
    """How near a monitor came to its trip in this run: the share of the limit that was used at most."""

    used: float
    at_s: float
    axis: str | None


class LatencyInfo(TypedDict):
    """How long the FRI client's last answer took, None where there was none, and how late the last cycle began."""

    answer_ms: float | None
    cycle_ms: float


class RobotInfo(TypedDict):
    """What stays the same of a robot while its controller runs; ``servo`` is None where it serves no applications."""

    model: str
    backend: str
    cycle_ms: int
    servo: str | None
    servo_key_file: str | None
    moves_real_drives: bool


class StationInfo(TypedDict):
    """What a controller serves; an object has the keys of an ``[[object]]`` of the station file."""

    robots: dict[str, RobotInfo]
    objects: list[dict[str, Any]]


class RobotState(TypedDict):
    """What the pad shows of one robot; names are those of :mod:`hil.values.operator` and :mod:`hil.values.fri`."""

    mode: str
    program: str
    enabling: bool
    override_percent: float
    safety_state: str
    reason: str
    permissive: bool
    drives: str
    session: SessionInfo | None
    commander: str | None
    last_stop: StopInfo | None
    closest: str
    margins: dict[str, MarginInfo]
    latency: LatencyInfo
    io: dict[str, SignalInfo]
    time_s: float
    cycles: int


class CaptureInfo(TypedDict):
    """A recording; ``state`` is recording, completing or complete. What follows ``dropped`` is there when complete."""

    state: str
    path: str
    dropped: int
    written: NotRequired[int]
    removed: NotRequired[int]
    error: NotRequired[str | None]


class RunningController(NamedTuple):
    """A controller of this user; ``robots`` is empty when it did not answer in time."""

    process: int
    socket: Path
    robots: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.socket} ({', '.join(self.robots) or 'does not answer'})"


class PadClient:
    """A pad, open inside its ``with`` block. One thread may use it.

    ``socket_path``: the controller's socket; without one the only running controller of this user is taken. ``robot``
    names the robot of a controller that has several. Methods raise :class:`PadRefused` when the controller does not do
    it, :class:`EndpointError` when there is no controller, or it does not answer within ``timeout_s``.
    """

    def __init__(
        self, socket_path: str | Path | None = None, *, robot: str | None = None, timeout_s: float = 5.0
    ) -> None:
        self._path = socket_path
        self._robot = robot
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._received = bytearray()
        self._last_id = 0
        self._watches = False

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def connect(self) -> None:
        """Connect to the controller; what ``with`` does."""
        self.close()
        path = only_controller() if self._path is None else checked_socket_path(str(self._path))
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        link.settimeout(self._timeout_s)
        try:
            link.connect(str(path))
        except OSError as error:
            link.close()
            raise EndpointError(f"no controller at {path}: {error.strerror or error}") from error
        self._socket = link

    def close(self) -> None:
        """Disconnect, which releases an enabling switch that is held; does nothing when it is closed."""
        link, self._socket = self._socket, None
        self._received.clear()
        self._watches = False
        if link is not None:
            link.close()

    def interrupt(self) -> None:
        """Make a :meth:`states` that waits in another thread end."""
        if self._socket is not None:
            self._socket.shutdown(socket.SHUT_RDWR)

    def enable(self, *, hold: bool = False) -> dict[str, RobotState]:
        """Hold the enabling switch; with ``hold`` it is let go when this client closes, however that comes."""
        return self._ask(PadKey.ENABLE.value, {"hold": True} if hold else {})

    def release(self) -> dict[str, RobotState]:
        """Let the enabling switch go."""
        return self._ask(PadKey.RELEASE.value)

    def start(self) -> dict[str, RobotState]:
        """Press the start key: motions run."""
        return self._ask(PadKey.START.value)

    def pause(self) -> dict[str, RobotState]:
        """Let the start key go: motions wait."""
        return self._ask(PadKey.PAUSE.value)

    def emergency_stop(self) -> dict[str, RobotState]:
        """Press the emergency stop, of all robots unless one was named."""
        return self._ask(PadKey.EMERGENCY_STOP.value)

    def reset(self) -> dict[str, RobotState]:
        """Pull the emergency stop out, and acknowledge the stop."""
        return self._ask(PadKey.RESET.value)

    def select_mode(self, mode: str) -> dict[str, RobotState]:
        """Turn the mode selector to T1, T2 or AUT."""
        return self._ask("mode", {"mode": mode})

    def set_override(self, percent: float) -> dict[str, RobotState]:
        """Set the program override, 0..100 %."""
        return self._ask("override", {"percent": percent})

    def push(
        self,
        force_n: tuple[float, float, float],
        *,
        link: int = JOINT_COUNT,
        moment_nm: tuple[float, float, float] = (0.0, 0.0, 0.0),
        duration_s: float = DEFAULT_PUSH_S,
    ) -> dict[str, RobotState]:
        """Push a simulated arm at the outer end of a link (7: at the flange); N and Nm, axes of the robot base."""
        told = {"link": link, "force_n": list(force_n), "moment_nm": list(moment_nm), "duration_s": duration_s}
        return self._ask("push", told)

    def set_input(self, name: str, value: bool | float) -> dict[str, RobotState]:
        """Set the input ``Group.Name``; outputs are the FRI client's."""
        return self._ask("io", {"name": name, "value": value})

    def status(self) -> dict[str, RobotState]:
        """Return what the pad shows, by robot."""
        return self._ask("status")

    def describe(self) -> StationInfo:
        """Return what stays the same while the controller runs: its robots, where they are served, its objects."""
        told = self._answer("describe", {})
        return {"robots": told["robots"], "objects": told["objects"]}

    def kst(self) -> dict[str, dict[str, Any] | None]:
        """Return what the KST server of each robot did; None for a robot without one."""
        robots: dict[str, dict[str, Any] | None] = self._answer("kst", {})["robots"]
        return robots

    def start_capture(self, writer: Path, file: Path, ring: str | None = None) -> CaptureInfo:
        """Record to the process that listens at ``writer`` and writes ``file``; ``ring`` is FILESxSIZE."""
        told: dict[str, object] = {"capture": "start", "writer": str(writer), "file": str(file)}
        return self._capture("capture", told if ring is None else {**told, "ring": ring})

    def stop_capture(self) -> CaptureInfo:
        """End the recording that runs; it is complete when :meth:`capture` says so."""
        return self._capture("capture", {"capture": "stop"})

    def capture(self) -> CaptureInfo | None:
        """Return what the controller says of its last recording; None where there was none."""
        return self._answer("status", {}).get("capture")

    def states(self) -> Iterator[dict[str, RobotState]]:
        """Yield what the pad shows: at once, at every change, and once a second; ends when the connection does.

        Raises :class:`PadRefused` when the controller says why it ends it.
        """
        if not self._watches:
            yield self._ask("watch")
            self._watches = True
        link = self._open()
        # Lines come once a second; a controller that is held up for longer is not gone.
        link.settimeout(None)
        try:
            while (told := self._line(link)) is not None:
                if told.get("ok") is not True:
                    raise PadRefused(str(told.get("error")), {})
                yield told["robots"]
        except OSError as error:
            raise EndpointError(f"the controller is gone: {error.strerror or error}") from error
        finally:
            if self._socket is link:
                link.settimeout(self._timeout_s)

    def _capture(self, what: str, more: dict[str, object]) -> CaptureInfo:
        told: CaptureInfo = self._answer(what, more)["capture"]
        return told

    def _ask(self, what: str, more: dict[str, object] | None = None) -> dict[str, RobotState]:
        robots: dict[str, RobotState] = self._answer(what, more or {})["robots"]
        return robots

    def _answer(self, what: str, more: dict[str, object]) -> dict[str, Any]:
        link = self._open()
        self._last_id += 1
        request: dict[str, object] = {"do": what, "id": self._last_id, **more}
        if self._robot is not None:
            request["robot"] = self._robot
        try:
            link.sendall(json.dumps(request).encode() + b"\n")
            while (told := self._line(link)) is not None:
                if told.get("ok") is False and told.get("id") in {self._last_id, None}:
                    raise PadRefused(str(told.get("error")), told.get("robots", {}))
                if told.get("id") == self._last_id and "watch" not in told:
                    return told
        except TimeoutError:
            self.close()
            raise EndpointError(f"the controller did not answer within {self._timeout_s:g} s") from None
        except OSError as error:
            self.close()
            raise EndpointError(f"the controller is gone: {error.strerror or error}") from error
        self.close()
        raise EndpointError("the controller closed the connection")

    def _line(self, link: socket.socket) -> dict[str, Any] | None:
        """Return the next line; None at the end of the connection."""
        while (end := self._received.find(b"\n")) < 0:
            data = link.recv(65536)
            if not data:
                return None
            self._received += data
            if len(self._received) > _MAX_LINE_BYTES:
                raise EndpointError(f"no line ends within {_MAX_LINE_BYTES} bytes; this is no controller")
        line = bytes(self._received[:end])
        del self._received[: end + 1]
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            raise EndpointError("what answers at the socket is no controller: it sent no JSON object")
        return told

    def _open(self) -> socket.socket:
        if self._socket is None:
            raise EndpointError("the pad is not connected; use it inside its with block")
        return self._socket


def running_controllers() -> list[RunningController]:
    """Return the controllers of this user that listen at the place chosen for them."""
    return [
        RunningController(process, file, _robots(file)) for process, file in sorted(_sockets()) if _surely_listens(file)
    ]


def only_controller() -> Path:
    """Return the socket of the only running controller of this user; raise :class:`EndpointError` that lists them."""
    found = [(process, file) for process, file in sorted(_sockets()) if _surely_listens(file)]
    if len(found) == 1:
        return found[0][1]
    if found:
        told = "; ".join(map(str, running_controllers()))
        raise EndpointError(f"{len(found)} controllers run: {told}; choose one with --socket")
    raise EndpointError(
        f"no controller runs that has its pad in {socket_folder()}; start one with hil run, or name its socket "
        f"(--socket)"
    )


def _sockets() -> list[tuple[int, Path]]:
    folder = socket_folder()
    try:
        problem = distrusted(folder)
        files = [] if problem else list(folder.iterdir())
    except OSError:
        return []
    if problem:
        raise EndpointError(f"the pad's folder {folder} {problem}; name a controller's socket (--socket)")
    return [(process, file) for file in files if (process := process_of(file)) is not None]


def _surely_listens(file: Path) -> bool:
    try:
        return listens(file)
    except OSError:
        return False


def _robots(file: Path) -> tuple[str, ...]:
    try:
        with PadClient(file, timeout_s=_LIST_TIMEOUT_S) as pad:
            return tuple(pad.status())
    except HilError:
        return ()
