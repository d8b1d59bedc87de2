"""Minutes of real time: real processes that are killed, stopped and flooded, and a disk that is full.

Each ordeal is a run of ``hil run`` with two MuJoCo arms, an FRI client at each and a servo application, and what it did
is in its status file. After an ordeal the controller must end in order, exit code 0, without a traceback.
"""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from hil.clock import Deadline, elapsed_ns
from tests.support.processes import ROOT, finish, hil, wait_for_line
from transport.udp import free_port

FLOOD_PER_S: Final = 100_000
DISK_MB: Final = 3
STARTS: Final = 10


@dataclass
class Ordeal:
    """What was done to a controller, and what it showed; the worst of its robots."""

    name: str
    seconds: float
    done: dict[str, float] = field(default_factory=dict)
    cycles: int = 0
    missed_percent: float = 0.0
    lateness_p99_us: float = 0.0
    rate_hz: float = 0.0
    resident_mb: tuple[float, float] = (0.0, 0.0)
    finding: str = ""
    not_tried: str = ""
    """Why it was not, where it was not."""


class Place:
    """Addresses of one station, and its file."""

    def __init__(self, folder: Path, host: str, stack: ExitStack) -> None:
        self.host = host
        self.folder = folder
        self.fri = (free_port(host), free_port(host))
        self.served = tuple(free_port(host) for _ in self.fri)
        self.servo = free_port(host)
        self.station = folder / "station.toml"
        self.status = folder / "status.json"
        self._stack = stack
        robots = [
            f'[[robot]]\nname = "arm{number}"\nbackend = "mujoco"\n'
            f'fri = {{ client = "{host}:{port}", bind = "{host}:{self.served[number]}" }}\n'
            for number, port in enumerate(self.fri)
        ]
        robots[0] += f'servo = {{ bind = "{host}:{self.servo}" }}\n'
        self.station.write_text("".join(robots), encoding="utf-8")

    def controller(self, *more: object) -> "subprocess.Popen[str]":
        """Start it, and wait until it serves."""
        process = hil(
            "run",
            self.station,
            "--status-json",
            self.status,
            "--progress",
            0,
            "--pad",
            "off",
            *more,
            station_links=True,
        )
        self._stack.callback(_end, process)
        wait_for_line(process, "applications at")
        return process

    def fri_client(self, number: int) -> "subprocess.Popen[bytes]":
        """Start an FRI client that lays a sine over its arm."""
        return self.start(
            "apps.fri_joint_sine", "--bind", self.host, "--port", str(self.fri[number]), "--seconds", "600"
        )

    def application(self) -> "subprocess.Popen[bytes]":
        """Start a servo application."""
        return self.start(
            "apps.smart_servo_joint_motion", "--controller", f"{self.host}:{self.servo}", "--seconds", "600"
        )

    def start(self, module: str, *arguments: str) -> "subprocess.Popen[bytes]":
        """Start a module of ours that is ended with the ordeal, if not before."""
        process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._stack.callback(_end, process)
        return process


def _end(process: "subprocess.Popen[Any]") -> None:
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGCONT)
        process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def _resident_mb(process: "subprocess.Popen[Any]") -> float:
    lines = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmRSS"))


def _let_pass(process: "subprocess.Popen[Any]", seconds: float) -> None:
    """Let time pass while ``process`` runs; raise AssertionError if it ends meanwhile."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
        raise AssertionError(f"the controller ended by itself with exit code {process.returncode}")


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """Mount a disk of some MB; raise OSError where that is not allowed."""
    folder.mkdir()
    mount, umount = shutil.which("mount"), shutil.which("umount")
    if mount is None or umount is None:
        raise OSError("there is no mount command")
    mounted = subprocess.run(
        [mount, "-t", "tmpfs", "-o", f"size={DISK_MB}m", "tmpfs", str(folder)],
        check=False,
        capture_output=True,
        text=True,
    )
    if mounted.returncode:
        raise OSError(f"no disk of {DISK_MB} MB can be mounted: {mounted.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run([umount, "-l", str(folder)], check=False)


Plague = Callable[[Place, "subprocess.Popen[str]", Ordeal], None]


def _quiet(_place: Place, controller: "subprocess.Popen[str]", ordeal: Ordeal) -> None:
    _let_pass(controller, ordeal.seconds)


def _kills(place: Place, controller: "subprocess.Popen[str]", ordeal: Ordeal) -> None:
    """Kill, stop and continue clients, and start new ones."""
    chance = random.Random(1)
    clients = [place.fri_client(0), place.fri_client(1), place.application()]
    makers = (lambda: place.fri_client(0), lambda: place.fri_client(1), place.application)
    ordeal.done = {"killed": 0, "stopped": 0}
    over = Deadline(ordeal.seconds)
    while (over.left_s() or 0.0) > 0.0:
        which = chance.randrange(len(clients))
        if chance.random() < 0.5:
            clients[which].kill()
            clients[which].wait()
            clients[which] = makers[which]()
            ordeal.done["killed"] += 1
        else:
            clients[which].send_signal(signal.SIGSTOP)
            _let_pass(controller, chance.uniform(0.02, 0.5))
            clients[which].send_signal(signal.SIGCONT)
            ordeal.done["stopped"] += 1
        _let_pass(controller, chance.uniform(0.1, 1.0))


def _flood(port_of: Callable[[Place], int]) -> Plague:
    def flood(place: Place, controller: "subprocess.Popen[str]", ordeal: Ordeal) -> None:
        seconds = ordeal.seconds
        clients = [place.fri_client(0), place.fri_client(1)]
        _let_pass(controller, 3.0)
        assert all(client.poll() is None for client in clients)
        stranger = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.flood", place.host, str(port_of(place)), str(FLOOD_PER_S), str(seconds)],
            cwd=ROOT, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        out, _ = stranger.communicate(timeout=seconds + 30.0)
        ordeal.done = {"datagrams a second": round(json.loads(out)["per_s"])}

    return flood


def _full_disk(place: Place, controller: "subprocess.Popen[str]", ordeal: Ordeal) -> None:
    clients = [place.fri_client(0), place.fri_client(1)]
    _let_pass(controller, ordeal.seconds)
    assert all(client.poll() is None for client in clients)


def soak(*, minutes: float, folder: Path, host: str, progress: Callable[[str], None]) -> list[Ordeal]:
    """Do every ordeal for its share of ``minutes``."""
    seconds = max(5.0, minutes * 60.0 / 6)
    plagues: tuple[tuple[str, Plague], ...] = (
        ("nothing", _quiet),
        ("clients killed and stopped", _kills),
        ("a stranger floods the FRI port", _flood(lambda place: place.served[0])),
        ("a stranger floods the servo port", _flood(lambda place: place.servo)),
    )
    ordeals = []
    for name, plague in plagues:
        progress(name)
        ordeals.append(_ordeal(name, plague, seconds, folder, host))
    progress("a full disk")
    ordeals.append(_disk_fills(seconds, folder, host))
    progress("the controller is killed")
    ordeals.append(_controller_dies(folder, host))
    return ordeals


def _disk_fills(seconds: float, folder: Path, host: str) -> Ordeal:
    name = f"a capture fills a disk of {DISK_MB} MB"
    try:
        with small_disk(folder / "disk") as disk:
            return _ordeal(name, _full_disk, seconds, folder, host, "--capture", disk / "run.pcapng")
    except OSError as error:
        return Ordeal(name, 0.0, not_tried=str(error))


def _ordeal(name: str, plague: Plague, seconds: float, folder: Path, host: str, *more: object) -> Ordeal:
    ordeal = Ordeal(name, seconds)
    with tempfile.TemporaryDirectory(dir=folder) as own, ExitStack() as stack:
        place = Place(Path(own), host, stack)
        try:
            controller = place.controller(*more)
            _let_pass(controller, 2.0)
            before_mb = _resident_mb(controller)
            plague(place, controller, ordeal)
            ordeal.resident_mb = (round(before_mb, 1), round(_resident_mb(controller), 1))
            ended = finish(controller, interrupt=True)
            assert ended.code == 0, f"exit code {ended.code}: {ended.err[-500:]}"
            assert "Traceback" not in ended.err, ended.err[-2000:]
            robots = json.loads(place.status.read_text(encoding="utf-8"))["robots"].values()
            ordeal.cycles = sum(robot["ticks"] for robot in robots)
            # Of those that were due: some of the missed ones were caught up, the others were left out.
            ordeal.missed_percent = round(
                max(robot["missed_cycles"] * robot["rate_hz"] / robot["ticks"] for robot in robots) / 10.0, 3
            )
            ordeal.lateness_p99_us = max(robot["lateness_us"]["p99"] for robot in robots)
            ordeal.rate_hz = round(min(robot["rate_hz"] for robot in robots), 2)
        except AssertionError as error:
            ordeal.finding = str(error)
    return ordeal


def _controller_dies(folder: Path, host: str) -> Ordeal:
    """Kill the controller and start it anew on the same ports: whoever waits for it must be served again."""
    ordeal = Ordeal("the controller is killed, and started anew", 0.0)
    slowest_s = 0.0
    with tempfile.TemporaryDirectory(dir=folder) as own, ExitStack() as stack:
        place = Place(Path(own), host, stack)
        place.fri_client(0)
        try:
            for _ in range(STARTS):
                began_ns = elapsed_ns()
                controller = place.controller()
                wait_for_line(controller, "COMMANDING_ACTIVE")
                slowest_s = max(slowest_s, (elapsed_ns() - began_ns) * 1e-9)
                os.kill(controller.pid, signal.SIGKILL)
                controller.wait()
        except AssertionError as error:
            ordeal.finding = str(error)
    ordeal.done = {"killed": STARTS, "slowest to COMMANDING_ACTIVE, s": round(slowest_s, 2)}
    return ordeal
