"""What fails while something is being opened closes what was opened before it."""

import asyncio
import errno
import os
import socket
import subprocess
import sys
from collections import deque
from contextlib import closing
from pathlib import Path
from typing import NoReturn, cast

import pytest

from backends.cabinet.options import CabinetOptions
from hil.client.pad import PadClient
from hil.client.servo import HilError
from hil.clock import MonotonicClock
from hil.config.station import KstConfig, RobotConfig, ServoConfig, Station
from hil.kst.robot import Robot
from hil.kst.server import KstServer
from hil.runtime import view_process
from hil.runtime.view_process import ViewPlace, ViewProcess
from hil.testkit import process as kit
from hil.testkit.process import HilProcess
from hil.values.errors import EndpointError
from hil.values.kst import KstSettings
from hil.values.link import Address
from tests.support.held import nothing_left
from tests.support.processes import own_host
from tools.campaign import local
from tools.shadow.comparison import ShadowComparison
from tools.shadow.live import watch
from tools.view import chromium
from transport.capture.errors import CaptureError
from transport.capture.process import CaptureProcess
from transport.tcp.sockets import listen


def no_more(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.EMFILE, "Too many open files")


def test_a_recording_whose_writer_cannot_be_reached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "socketpair", no_more)
    with nothing_left(), pytest.raises(CaptureError, match="Too many open files"):
        CaptureProcess(tmp_path / "run.pcapng", comment="")


def test_a_recording_whose_writer_cannot_be_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "Popen", no_more)
    with nothing_left(), pytest.raises(CaptureError, match="cannot be started: Too many open files"):
        CaptureProcess(tmp_path / "run.pcapng", comment="")


def test_a_view_that_may_not_be_made_nicer_is_a_view_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = [sys.executable, "-S", "-c", "import sys; sys.stdin.read()"]
    monkeypatch.setattr(view_process, "module_command", lambda *_: waits)
    monkeypatch.setattr(os, "setpriority", no_more)

    async def opened_and_closed() -> int:
        return ViewProcess(ViewPlace(), Path("pad.sock"), say=lambda _line: None).close()

    with nothing_left():
        assert asyncio.run(opened_and_closed()) == 0


def test_a_browser_that_cannot_be_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chromium, "CHROMIUM", "chromium")
    monkeypatch.setattr(subprocess, "Popen", no_more)
    with nothing_left(), pytest.raises(EndpointError, match="cannot be started: Too many open files"):
        chromium.Chromium(tmp_path)


def test_a_campaign_worker_that_cannot_be_ended_keeps_no_other() -> None:
    ended: list[int] = []

    class Worker:
        def __init__(self, number: int) -> None:
            self.number = number

        def end(self) -> None:
            ended.append(self.number)
            raise ValueError("it still runs")

    pool = local._Pool(deque(), patience_s=1.0, retries=0)
    pool._staff = [cast("local._Worker", Worker(number)) for number in range(3)]
    with pytest.raises(ValueError, match="still runs"):
        pool.end()
    assert sorted(ended) == [0, 1, 2]


class _Closed:
    """A comparison of which only the end matters."""

    closed = False

    def close(self) -> None:
        """Note it."""
        self.closed = True


def test_a_shadow_whose_address_is_taken_releases_its_arm() -> None:
    comparison = _Closed()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken:
        taken.bind((own_host(), 0))
        options = CabinetOptions(bind="{}:{}".format(*taken.getsockname()))
        watching = watch(cast("ShadowComparison", comparison), options, seconds=0.0, tell=lambda _line: None)
        with nothing_left(), pytest.raises(EndpointError, match="another FRI client"):
            asyncio.run(watching)
    assert comparison.closed


def test_a_shadow_whose_reader_is_gone_releases_its_socket() -> None:
    comparison = _Closed()
    options = CabinetOptions(bind=f"{own_host()}:0")
    watching = watch(cast("ShadowComparison", comparison), options, seconds=0.0, tell=no_more)
    with nothing_left(), pytest.raises(OSError, match="Too many"):
        asyncio.run(watching)
    assert comparison.closed


class _Broken:
    """A session at the controller that can be neither begun nor ended."""

    is_there = False

    async def connect(self) -> None:
        """Refuse."""
        raise HilError("nobody answers")

    async def close(self) -> None:
        """Fail."""
        raise RuntimeError("the goodbye failed")


class _Lost(_Broken):
    """A session at the controller whose state cannot be told."""

    async def connect(self) -> None:
        """Begin."""

    async def close(self) -> None:
        """End."""

    def state(self) -> NoReturn:
        """Fail."""
        raise RuntimeError("there is no state")

    @property
    def is_there(self) -> NoReturn:  # type: ignore[override]  # it fails
        """Fail."""
        raise RuntimeError("nobody knows")


async def served_twice(robot: type[_Broken]) -> list[str]:
    """Serve two clients one after the other; both are let go. Return what was told."""
    told: list[str] = []
    listener = listen(Address(own_host(), 0), backlog=4)
    seven = (1.0,) * 7
    settings = KstSettings(position_min_rad=seven, position_max_rad=seven, velocity_max_rad_s=seven)
    server = KstServer(
        listener, settings=settings, make_robot=lambda _tell: cast("Robot", robot()), clock=MonotonicClock(),
        tell=told.append,
    )  # fmt: skip
    address = listener.getsockname()
    serving = asyncio.create_task(server.serve())
    async with asyncio.timeout(10):
        for _ in range(2):
            reader, writer = await asyncio.open_connection(*address)
            assert await reader.read() == b""
            writer.close()
            await writer.wait_closed()
        server.stop()
        await serving
    assert server.sessions == 2
    return told


async def test_a_kst_session_that_ends_badly_does_not_keep_the_next_client_out() -> None:
    told = await served_twice(_Broken)
    assert sum("did not end in order" in line for line in told) == 2


async def test_a_kst_session_that_cannot_be_watched_lets_its_client_go() -> None:
    told = await served_twice(_Lost)
    assert sum("which is a fault of the server: RuntimeError('nobody knows')" in line for line in told) == 2


def test_a_test_process_whose_pad_fails_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[object] = []

    class Child:
        def __init__(self, *_: object) -> None:
            self.output = ""

        def wait_for(self, _text: str) -> list[str]:
            return [""]

        def end(self, *how: object) -> int:
            ended.append(how)
            return 0

    def gone(_pad: PadClient) -> NoReturn:
        raise EndpointError("the controller is gone")

    monkeypatch.setattr(kit, "Child", Child)
    monkeypatch.setattr(PadClient, "connect", lambda _pad: None)
    monkeypatch.setattr(PadClient, "kst", gone)
    robot = RobotConfig(backend="ideal", servo=ServoConfig(), kst=KstConfig())
    with pytest.raises(EndpointError, match="is gone"):
        HilProcess(Station(robot=[robot]), tmp_path)
    assert len(ended) == 1
