"""A controller process for a test: ``hil run`` on addresses of its own, ready when the test begins, ended after it."""

import itertools
import json
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from hil.client.pad import PadClient
from hil.config.station import Station
from hil.testkit.errors import ProcessFailed
from hil.testkit.operator import Operator
from hil.values.arm import Push
from hil.values.errors import EndpointError, UsageError
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput
from transport.udp import parse_address

START_S: Final = 60.0
"""A controller that has not started after so long will not."""
STOP_S: Final = 20.0
MOST_LINES: Final = 2_000
_READY: Final = "pad: hil pad finds this controller at"
_numbers: Final = itertools.count()


class HilProcess:
    """A running controller. :meth:`stop` ends it, and so does the end of the test."""

    def __init__(self, station: Station, folder: Path) -> None:
        host = free_host()
        robot = station.robot[0]
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._news: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._status_file = folder / "status.json"
        self._status: dict[str, Any] | None = None
        self._servo_address: str | None = None
        self._fri_client_address: str | None = None
        content = station.model_dump(mode="json", exclude_unset=True)
        [told] = content["robot"]
        if robot.fri is not None:
            self._fri_client_address = f"{host}:{free_port(host)}"
            told["fri"] = {**told["fri"], "client": self._fri_client_address, "bind": f"{host}:0"}
        if robot.servo is not None:
            told["servo"] = {**told["servo"], "bind": f"{host}:0"}
        self.pad_socket = folder / "pad.sock"
        content["pad"] = str(self.pad_socket)
        file = folder / "station.toml"
        file.write_text("".join(f"{key} = {toml(value)}\n" for key, value in content.items()), encoding="utf-8")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli.main", "run", str(file), "--status-json", str(self._status_file)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, name="output of hil run", daemon=True)
        self._reader.start()
        try:
            self._wait_until_ready()
            self._pad = PadClient(self.pad_socket)
            self._pad.connect()
        except BaseException:
            self._end(signal.SIGKILL)
            raise
        self.operator: Operator = _PadOperator(self._pad)
        """The operator's pad."""

    @property
    def fri_client_address(self) -> str:
        """``HOST:PORT`` where the FRI client has to bind: nobody else is there."""
        if self._fri_client_address is None:
            raise UsageError("this controller has no FRI link; it was configured with fri=None")
        return self._fri_client_address

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
        if self._servo_address is None:
            raise UsageError("this controller has no servo link; it was configured with servo=None")
        return self._servo_address

    @property
    def output(self) -> str:
        """What it printed so far, the last two thousand lines."""
        return "\n".join(self._lines)

    def pad(self) -> Mapping[str, Any]:
        """Return what the operator's pad shows of the robot; see :class:`hil.client.pad.RobotState`."""
        [state] = self._pad.status().values()
        return state

    def stop(self) -> dict[str, Any]:
        """End it in order, if it runs, and return :meth:`status`; raise :class:`ProcessFailed` if it did not obey."""
        if self._process.poll() is None:
            self._pad.close()
            self._end(signal.SIGINT)
        if self._process.returncode != 0:
            raise ProcessFailed(f"hil run ended with exit code {self._process.returncode}; it said:\n{self.output}")
        return self.status()

    def status(self) -> dict[str, Any]:
        """Return the robot's part of the status file, which is there once it has ended; raise :class:`UsageError`."""
        if self._status is None:
            if self._process.poll() is None:
                raise UsageError("the status file is written at the end of hil run: call stop() before status()")
            [self._status] = json.loads(self._status_file.read_text(encoding="utf-8"))["robots"].values()
        return dict(self._status)

    def close(self) -> None:
        """End it, if it runs, and release everything; never raises for what the process did."""
        self._pad.close()
        if self._process.poll() is None:
            self._end(signal.SIGINT)

    def _end(self, number: signal.Signals) -> None:
        """Send this one process a signal, and wait; one that does not obey is killed."""
        self._process.send_signal(number)
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self._lines.append(line.rstrip("\n"))
            self._news.put(line)
        self._news.put(None)

    def _wait_until_ready(self) -> None:
        while True:
            try:
                line = self._news.get(timeout=START_S)
            except queue.Empty:
                raise ProcessFailed(f"hil run was not ready within {START_S:g} s; it said:\n{self.output}") from None
            if line is None:
                code = self._process.wait()
                raise ProcessFailed(f"hil run ended at once, exit code {code}; it said:\n{self.output}")
            if found := re.search(r"applications at (\S+),", line):
                self._servo_address = found[1]
            if _READY in line:
                return


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
