"""Cycles of our controller in this thread, as fast as they go: what ``franky_loop`` is for the peer. Writes JSON."""

import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hil.clock import elapsed_ns
from hil.config.station import FriConfig, RobotConfig
from hil.core.controller import FRI_LINK
from hil.runtime.assembly import open_parts
from hil.values.fri import Release
from hil.values.link import Source
from tools.bench.clients import PEER, BenchMotion, Datagrams, recorded_client
from tools.bench.cycle import WARM_UP_CYCLES, CycleLoop, record_client

_HOST: Final = "127.0.0.1"
_LONGEST_BYTES: Final = 1 << 16


def main(
    cycles: Annotated[int, typer.Option()],
    out: Annotated[Path, typer.Option()],
    robot: Annotated[str, typer.Option()] = "lbr-iiwa-14-r820",
    fri_version: Annotated[Release, typer.Option()] = Release.V1_15,
) -> None:
    """Measure both and write them to a file."""
    config = RobotConfig(model=robot, backend="mujoco", enabled=True, fri=FriConfig(release=fri_version))
    recording = record_client(config, recorded_client(config, BenchMotion.FRI_OVERLAY), cycles)
    found = {"bare": _measured(config, recording, _bare), "loop": _measured(config, recording, _over_sockets)}
    out.write_text(json.dumps(found), encoding="utf-8")


def _measured(
    config: RobotConfig, recording: list[Datagrams], measure: Callable[[CycleLoop, list[Datagrams]], list[int]]
) -> dict[str, Any]:
    client = recorded_client(config, BenchMotion.FRI_OVERLAY)
    parts = open_parts(config)
    try:
        loop = CycleLoop(config, parts)
        loop.warm_up(recording[:WARM_UP_CYCLES], client)
        samples = measure(loop, recording[WARM_UP_CYCLES:-1])
        client.check(loop.controller)
        return {"samples_ns": samples}
    finally:
        parts.backend.close()


def _bare(loop: CycleLoop, recording: list[Datagrams]) -> list[int]:
    return [sum(loop.cycle(datagrams)) for datagrams in recording]


def _over_sockets(loop: CycleLoop, recording: list[Datagrams]) -> list[int]:
    """The same with a client over loopback, which is not measured; our side asks until there is no more."""
    samples = []
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        ours.bind((_HOST, 0))
        client.bind((_HOST, 0))
        ours.setblocking(False)
        client.settimeout(1.0)
        for datagrams in recording:
            for _, datagram in datagrams:
                client.sendto(datagram, ours.getsockname())
            before_ns = elapsed_ns()
            loop.cycle(_received(ours))
            for outgoing in loop.outgoing:
                ours.sendto(outgoing.payload, client.getsockname())
            samples.append(elapsed_ns() - before_ns)
            for _ in loop.outgoing:
                client.recv(_LONGEST_BYTES)
    return samples


def _received(sock: socket.socket) -> Datagrams:
    received: list[tuple[Source, bytes]] = []
    while True:
        try:
            datagram, _ = sock.recvfrom(_LONGEST_BYTES)
        except BlockingIOError:
            return tuple(received)
        received.append((Source(FRI_LINK, PEER), datagram))


if __name__ == "__main__":
    typer.run(main)
