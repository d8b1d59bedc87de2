"""A controller process for a test: ``hil run`` on addresses of its own, ready when the test begins, ended after it."""

import itertools
import json
import os
import re
import signal
import socket
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from hil.client.pad import PadClient
from hil.config.station import Station
from hil.testkit._child import Child
from hil.testkit.operator import Operator
from hil.values.arm import Push
from hil.values.errors import EndpointError, UnknownName, UsageError
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput
from transport.impairment import Fault, parse_fault
from transport.udp import parse_address

_READY: Final = "pad: hil pad finds this controller at"
_LINKS: Final = ("fri", "servo")
_numbers: Final = itertools.count()


class HilProcess:
    """A running controller. :meth:`stop` ends it, and so does the end of the test."""

    def __init__(self, station: Station, folder: Path) -> None:
        host = free_host()
        [robot] = station.robot
        self._folder = folder
        self._status_file = folder / "status.json"
        self._status: dict[str, Any] | None = None
        self._impairments: list[tuple[Child, Path]] = []
        self._figures: list[dict[str, Any]] | None = None
        self._addresses: dict[str, str] = {}
        """Where the other side of a link has to be, or to go."""
        content = station.model_dump(mode="json", exclude_unset=True)
        [told] = content["robot"]
        if robot.fri is not None:
            self._addresses["fri"] = f"{host}:{free_port(host)}"
            told["fri"] = {**told["fri"], "client": self._addresses["fri"], "bind": f"{host}:0"}
        if robot.servo is not None:
            told["servo"] = {**told["servo"], "bind": f"{host}:0"}
        if robot.kst is not None:
            told["kst"] = {**told["kst"], "bind": f"{host}:0"}
        self.pad_socket = folder / "pad.sock"
        content["pad"] = str(self.pad_socket)
        file = folder / "station.toml"
        file.write_text("".join(f"{key} = {toml(value)}\n" for key, value in content.items()), encoding="utf-8")
        self._child = Child("run", file, "--status-json", self._status_file)
        self._pad = PadClient(self.pad_socket)
        try:
            lines = self._child.wait_for(_READY)
            self._pad.connect()
            if found := re.search(r"applications at (\S+),", "".join(lines)):
                self._addresses["servo"] = found[1]
            if robot.kst is not None:
                [served] = self._pad.kst().values()
                self._addresses["kst"] = "" if served is None else str(served["address"])
        except BaseException:
            self._pad.close()
            self._child.end(signal.SIGKILL)
            raise
        self.operator: Operator = _PadOperator(self._pad)
        """The operator's pad."""

    @property
    def fri_client_address(self) -> str:
        """``HOST:PORT`` where the FRI client has to bind: nobody else is there."""
        return self._address("fri")

    @property
    def fri_client_host(self) -> str:
        """Host of it."""
        return parse_address(self.fri_client_address, default_port=0).host

    @property
    def fri_client_port(self) -> int:
        """Port of it."""
        return parse_address(self.fri_client_address, default_port=0).port

    @property
    def servo_address(self) -> str:
        """``HOST:PORT`` where servo applications connect to."""
        return self._address("servo")

    @property
    def kst_address(self) -> str:
        """``HOST:PORT`` where KST programs connect to; with ``kst={}`` in the mark."""
        return self._address("kst")

    @property
    def output(self) -> str:
        """What it printed so far, the last two thousand lines; then what its bad networks printed."""
        return "\n".join(child.output for child in (self._child, *(child for child, _ in self._impairments)))

    def pad(self) -> Mapping[str, Any]:
        """Return what the operator's pad shows of the robot; see :class:`hil.client.pad.RobotState`."""
        [state] = self._pad.status().values()
        return state

    def impair(self, link: str, *faults: Fault | str, seed: int = 0) -> None:
        """Put a bad network, ``hil impair``, between ``link`` (``fri`` or ``servo``) and its other side.

        From now on the address of that link is another one. A fault that never fires fails :meth:`stop`.
        """
        if link not in _LINKS:
            raise UnknownName("link", link, _LINKS)
        told = [str(parse_fault(fault) if isinstance(fault, str) else fault) for fault in faults]
        host, before = free_host(), self._address(link)
        listen, to = (before, f"{host}:{free_port(host)}") if link == "fri" else (f"{host}:0", before)
        figures = self._folder / f"impair-{len(self._impairments)}.json"
        child = Child(
            "impair", "--link", link, "--listen", listen, "--to", to, "--seed", seed, "--json", figures,
            "--progress", 0, "--require-fired", *(word for text in told for word in ("--fault", text)),
        )  # fmt: skip
        self._impairments.append((child, figures))
        stands = child.wait_for(" stands for ")[-1].partition(" ")[0]
        self._addresses[link] = to if link == "fri" else stands

    def impairments(self) -> list[dict[str, Any]]:
        """Return the figures of the bad networks, in the order they were made, once :meth:`stop` was called."""
        if self._figures is None:
            raise UsageError("hil impair writes its figures at its end: call stop() before impairments()")
        return list(self._figures)

    def stop(self) -> dict[str, Any]:
        """End it in order, if it runs, and return :meth:`status`.

        Raises :class:`ProcessFailed` if it did not end as it should, or a bad network had a fault that never fired.
        """
        if self._figures is not None:
            return self.status()
        self._pad.close()
        self._child.end_in_order()
        for child, _ in self._impairments:
            child.end_in_order()
        self._figures = [json.loads(figures.read_text(encoding="utf-8")) for _, figures in self._impairments]
        return self.status()

    def status(self) -> dict[str, Any]:
        """Return the robot's part of the status file, which is there once it has ended; raise :class:`UsageError`."""
        if self._status is None:
            if self._child.running:
                raise UsageError("the status file is written at the end of hil run: call stop() before status()")
            [self._status] = json.loads(self._status_file.read_text(encoding="utf-8"))["robots"].values()
        return dict(self._status)

    def close(self) -> None:
        """End everything that runs, and release it; never raises for what a process did."""
        self._pad.close()
        for child in (self._child, *(child for child, _ in self._impairments)):
            child.end()

    def _address(self, link: str) -> str:
        if link not in self._addresses:
            name = link if link == "servo" else link.upper()
            raise UsageError(f"this controller has no {name} link; it was configured with {link}=None")
        return self._addresses[link]


@contextmanager
def controller_process(station: Station) -> Iterator[HilProcess]:
    """Run a controller process for ``station`` until the block ends; raise :class:`ProcessFailed`."""
    # Its own short folder: the path of a socket may have a hundred bytes, and pytest's folders have more.
    with tempfile.TemporaryDirectory(prefix="hil-") as folder:
        process = HilProcess(station, Path(folder))
        try:
            yield process
        finally:
            process.close()


class _PadOperator(Operator):
    def __init__(self, pad: PadClient) -> None:
        self._pad = pad

    def _do(self, action: OperatorAction) -> None:
        pad = self._pad
        if isinstance(action, Press):
            keys = {
                PadKey.ENABLE: pad.enable,
                PadKey.RELEASE: pad.release,
                PadKey.START: pad.start,
                PadKey.PAUSE: pad.pause,
                PadKey.EMERGENCY_STOP: pad.emergency_stop,
                PadKey.RESET: pad.reset,
            }
            keys[action.key]()
        elif isinstance(action, SelectMode):
            pad.select_mode(action.mode.name)
        elif isinstance(action, SetInput):
            pad.set_input(action.name, action.value)
        elif isinstance(action, Push):
            pad.push(action.force_n, link=action.link, moment_nm=action.moment_nm, duration_s=action.duration_s)
        else:
            pad.set_override(action.percent)


def free_host() -> str:
    """Return a loopback address that nothing else of this test run uses; 127.0.0.1 where there is but one."""
    number = next(_numbers)
    host = f"127.{101 + os.getpid() % 120}.{number // 250 % 250}.{number % 250 + 2}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((host, 0))
        except OSError:
            return "127.0.0.1"
    return host


def free_port(host: str) -> int:
    """Return a UDP port that is free at ``host`` now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((host, 0))
        except OSError as error:
            raise EndpointError(f"no free UDP port at {host}: {error.strerror}") from error
        return int(trial.getsockname()[1])


def toml(value: object) -> str:
    """Return a value of a station as TOML, sections inline."""
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(key)} = {toml(item)}" for key, item in value.items() if item is not None)
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(toml, value))}]"
    # Texts, numbers and truth values look the same in both.
    return json.dumps(value)
