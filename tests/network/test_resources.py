"""Whatever ends a run, nothing of it is left: no descriptor, no thread, no process, no task."""

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable
from contextlib import closing
from pathlib import Path
from typing import TypeVar

import pytest

from backends.ideal import IdealBackend
from hil.client.fri import AsyncFriClient, FriClient, FriHandler, NothingHeard, Release
from hil.client.servo import AsyncServoClient, ControllerSilent, ServoClient
from hil.clock import MonotonicClock, let_others_run
from hil.config.station import FriConfig, KstConfig, RobotConfig, ServoConfig, Station, TcpProbeConfig
from hil.runtime import run as shell
from hil.runtime.relay import open_relay
from hil.runtime.robot_process import RobotProcess
from hil.runtime.run import RunOptions, RunResult
from hil.values.errors import BackendError, EndpointError
from hil.values.link import Address
from tests.support.cli import cli
from tests.support.held import held, nothing_left
from tests.support.processes import own_host
from tests.support.servo_served import served
from tools.view.sources import from_addresses
from tools.view.watch import Watch
from transport.impairment import Direction, Network

_T = TypeVar("_T")
RUN_S = 0.1


def station(folder: Path, **changes: object) -> Station:
    """A robot with every link and what runs beside a controller."""
    host = own_host()
    first = {
        "fri": FriConfig(client=f"{own_host()}:30200", bind=f"{host}:0"),
        "servo": ServoConfig(bind=f"{host}:0"),
        "kst": KstConfig(bind=f"{host}:0"),
        "backend": "ideal",
    }
    return Station.model_validate(
        {
            "pad": str(folder / "pad.sock"),
            "capture": folder / "run.pcapng",
            "tcp_probe": TcpProbeConfig(bind=f"{host}:0"),
            "robot": [RobotConfig.model_validate(first)],
            **changes,
        }
    )


def one(backend: str, **more: object) -> RobotConfig:
    """A robot with the two links over UDP."""
    host = own_host()
    fri = FriConfig(client=f"{own_host()}:30200", bind=f"{host}:0", send_period_ms=4)
    return RobotConfig.model_validate(
        {"name": backend, "backend": backend, "fri": fri, "servo": ServoConfig(bind=f"{host}:0"), **more}
    )


async def run(station: Station) -> RunResult:
    return await shell._Run(station, RunOptions(duration_s=RUN_S, progress_s=0.0)).run()


def leaves_nothing(work: Callable[[], Awaitable[_T]]) -> _T:
    """Return what ``work`` returns in an event loop of its own, that finds no task when it has ended."""

    async def alone() -> _T:
        before = held()
        try:
            return await work()
        finally:
            # The event loop closes sockets in the pass after.
            await let_others_run(2)
            assert held().left_since(before) == {}

    return asyncio.run(alone())


def test_every_link_and_robot_side_twice(tmp_path: Path) -> None:
    quiet = station(tmp_path)
    robots = [*quiet.robot, one("can402", cycle_ms=4, options={"simulated": True}), one("mujoco")]
    everything = quiet.model_copy(update={"robot": robots})
    with nothing_left():
        for _ in range(2):
            assert leaves_nothing(lambda: run(everything)).fault is None


def small(folder: Path, **changes: object) -> Station:
    """A robot that starts at once, with what this process itself has open for it."""
    return Station.model_validate({"pad": str(folder / "pad.sock"), "robot": [one("ideal")], **changes})


def test_a_robot_side_that_fails_in_a_cycle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_self: IdealBackend) -> None:
        raise BackendError("the drives are gone")

    monkeypatch.setattr(IdealBackend, "_step", fails)
    with nothing_left():
        assert "the drives are gone" in str(leaves_nothing(lambda: run(small(tmp_path))).fault)


def test_a_fault_of_ours_in_a_cycle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def fails(*_: object) -> None:
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setattr(RobotProcess, "_one_cycle", fails)
    with nothing_left(), pytest.raises(ExceptionGroup, match="unhandled errors"):
        leaves_nothing(lambda: run(small(tmp_path)))


def test_a_cancelled_run(tmp_path: Path) -> None:
    async def cancelled() -> None:
        running = asyncio.create_task(shell._Run(small(tmp_path), RunOptions(progress_s=0.0)).run())
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(asyncio.shield(running), RUN_S)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running

    with nothing_left():
        leaves_nothing(cancelled)


def test_a_robot_side_that_cannot_be_closed_keeps_nothing_else_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_self: IdealBackend) -> None:
        raise BackendError("the bus does not let go")

    monkeypatch.setattr(IdealBackend, "close", fails)
    robots = [one("ideal"), one("ideal").model_copy(update={"name": "other"})]
    with nothing_left(), pytest.raises(BackendError, match="does not let go"):
        leaves_nothing(lambda: run(small(tmp_path, robot=robots, capture=tmp_path / "run.pcapng")))


def test_a_second_robot_whose_address_is_taken_leaves_nothing_of_the_first(tmp_path: Path) -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken:
        taken.bind((own_host(), 0))
        bind = "{}:{}".format(*taken.getsockname())
        robots = [one("ideal"), one("ideal", servo=ServoConfig(bind=bind)).model_copy(update={"name": "second"})]
        with nothing_left(), pytest.raises(EndpointError, match=f"cannot bind UDP {bind}"):
            leaves_nothing(lambda: run(small(tmp_path, robot=robots)))


def test_the_clients_of_a_servo_link(tmp_path: Path) -> None:
    async def asynchronous(address: str) -> None:
        async with AsyncServoClient(address) as client:
            client.read_state()

    with served() as controller:
        for _ in range(2):
            with nothing_left():
                with ServoClient(controller.address) as client:
                    client.read_state()
                leaves_nothing(lambda: asynchronous(controller.address))


def test_the_clients_of_a_servo_link_that_nobody_serves() -> None:
    nowhere = f"{own_host()}:9"

    async def asynchronous() -> None:
        await AsyncServoClient(nowhere, connect_timeout_s=0.05).connect()

    with nothing_left():
        with pytest.raises(ControllerSilent):
            ServoClient(nowhere, connect_timeout_s=0.05).connect()
        with pytest.raises(ControllerSilent):
            leaves_nothing(asynchronous)
        with pytest.raises(ControllerSilent):
            Watch(from_addresses([nowhere]), connect_timeout_s=0.05).open()


def test_the_clients_of_an_fri_link_that_nobody_serves() -> None:
    async def asynchronous() -> None:
        async with AsyncFriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=own_host()) as client:
            await client.run(silence_s=0.05)

    with nothing_left():
        with (
            pytest.raises(NothingHeard),
            FriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=own_host()) as client,
        ):
            client.run(silence_s=0.05)
        with pytest.raises(NothingHeard):
            leaves_nothing(asynchronous)


def test_an_impairment_that_is_cancelled_while_it_passes_datagrams_on() -> None:
    async def passes() -> None:
        host = own_host()
        relay = await open_relay(
            Network([]), listen=Address(host, 0), to=Address(host, 9), towards=Direction.TO_PEER, forward_from=None,
            clock=MonotonicClock(),
        )  # fmt: skip
        running = asyncio.create_task(relay.run())
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as speaker:
            speaker.sendto(b"hello", relay.local)
            while not relay.lines:
                await let_others_run(1)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        relay.close()

    with nothing_left():
        leaves_nothing(passes)


def test_the_tools_that_meet_nobody() -> None:
    nowhere = f"{own_host()}:9"
    with nothing_left():
        for arguments in (
            ("doctor", "tcp", nowhere),
            ("doctor", "udp", nowhere, "--seconds", 1),
            ("doctor", "kst", nowhere),
            ("top", "--socket", "/nowhere/pad.sock"),
            ("pad", "status", "--socket", "/nowhere/pad.sock"),
        ):
            ended = cli(*arguments)
            assert ended.code not in {0, None}, arguments
            assert "Traceback" not in ended.err
