"""The client of a state stream, a process of its own: notes when each state arrives. Writes JSON.

It blocks in a receive, as clients do, and reads the clock when that returns: its own wake-up is in the figures, the
same for each server. With ``--command`` it answers each state with the next position of a sine over axis 4.
"""

import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Protocol

import typer

from apps.fri_joint_sine import JointSine
from hil.client.fri import ClientSession, Release
from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
from tools.bench.peers import franka_wire
from tools.bench.peers.franka_client import PATIENCE_S, FrankaClient
from tools.bench.peers.sine import AMPLITUDE_RAD, AXIS, FREQUENCY_HZ
from transport.fri import FriCodec

_HOST: Final = "127.0.0.1"
_LONGEST_BYTES: Final = 1 << 16
_TICK_S: Final = 1.0 / os.sysconf("SC_CLK_TCK")


class Speaks(StrEnum):
    """What the server speaks."""

    FRI = "fri"
    FRANKA = "franka"


class _Link(Protocol):
    def receive(self) -> tuple[bytes, tuple[str, int]]:
        """Return the next state and its sender; raise :class:`TimeoutError`."""

    def answer(self, state: bytes, sender: tuple[str, int]) -> None:
        """Command the next position, once the server takes one."""

    def counter(self, state: bytes) -> int:
        """Return the number of a state."""

    def axis_rad(self, state: bytes) -> float:
        """Return the measured position of the axis that is moved."""


class _Fri:
    def __init__(self, port: int, release: Release) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((_HOST, port))
        self._socket.settimeout(PATIENCE_S)
        self._session = ClientSession(
            release, JointSine(joints=(AXIS + 1,), amplitude_rad=AMPLITUDE_RAD, frequency_hz=FREQUENCY_HZ)
        )
        self._codec = FriCodec(release)

    def close(self) -> None:
        self._socket.close()

    def receive(self) -> tuple[bytes, tuple[str, int]]:
        return self._socket.recvfrom(_LONGEST_BYTES)

    def answer(self, state: bytes, sender: tuple[str, int]) -> None:
        answer = self._session.receive(state)
        if answer is not None:
            self._socket.sendto(answer, sender)

    def counter(self, state: bytes) -> int:
        return self._codec.decode_monitoring(state).sequence_counter

    def axis_rad(self, state: bytes) -> float:
        monitor = self._codec.decode_monitoring(state).monitor
        if monitor is None or monitor.measured_position is None:
            raise EndpointError("an FRI message without measured positions came in the middle of a session")
        return monitor.measured_position[AXIS]


class _Franka:
    def __init__(self, client: FrankaClient, *, move: bool) -> None:
        self._client = client
        self._moves = False
        if move:
            client.ask_to_move()

    def receive(self) -> tuple[bytes, tuple[str, int]]:
        return self._client.receive()

    def answer(self, state: bytes, sender: tuple[str, int]) -> None:
        self._moves = self._moves or self._client.has_begun_to_move()
        if self._moves:
            self._client.answer(state, sender)

    def counter(self, state: bytes) -> int:
        return franka_wire.state_counter(state)

    def axis_rad(self, state: bytes) -> float:
        return franka_wire.measured_position_rad(state)[AXIS]


@contextmanager
def _opened(protocol: Speaks, *, host: str, port: int, release: Release, command: bool) -> Iterator[_Link]:
    if protocol is Speaks.FRANKA:
        with FrankaClient(host) as client:
            # A server may take one request a cycle: what it has to say first has come when the first state comes.
            client.receive()
            yield _Franka(client, move=command)
        return
    link = _Fri(port, release)
    try:
        yield link
    finally:
        link.close()


def main(  # noqa: PLR0917  # typer makes the options of the parameters
    protocol: Annotated[Speaks, typer.Argument()],
    out: Annotated[Path, typer.Option()],
    seconds: Annotated[float, typer.Option()],
    settle: Annotated[float, typer.Option(help="Seconds after the first state that are not measured.")],
    server: Annotated[int, typer.Option(help="Process number of the server.")],
    host: Annotated[str, typer.Option(help="Of a libfranka server.")] = _HOST,
    port: Annotated[int, typer.Option(help="Of ours, where FRI states come to.")] = 0,
    fri_version: Annotated[Release, typer.Option()] = Release.V1_15,
    command: Annotated[bool, typer.Option("--command")] = False,
) -> None:
    """Measure one stream."""
    with _opened(protocol, host=host, port=port, release=fri_version, command=command) as link:
        found = _measure(link, seconds=seconds, settle_s=settle, server=server, command=command)
    out.write_text(json.dumps(found), encoding="utf-8")


def _measure(link: _Link, *, seconds: float, settle_s: float, server: int, command: bool) -> dict[str, Any]:
    _receive_for(link, settle_s, command=command)
    used_s = _processor_s(server)
    began_ns = elapsed_ns()
    arrived_ns, states = _receive_for(link, seconds, command=command)
    used_s = _processor_s(server) - used_s
    took_s = (elapsed_ns() - began_ns) * 1e-9
    axis_rad = [link.axis_rad(state) for state in states[:: max(1, len(states) // 1000)]]
    return {
        "arrived_ns": arrived_ns,
        "counters": [link.counter(state) for state in states],
        "state_bytes": len(states[-1]),
        "server_cores": used_s / took_s,
        "moved_rad": max(axis_rad) - min(axis_rad),
    }


def _receive_for(link: _Link, seconds: float, *, command: bool) -> tuple[list[int], list[bytes]]:
    arrived_ns: list[int] = []
    states: list[bytes] = []
    until_ns = elapsed_ns() + int(seconds * 1e9)
    now_ns = 0
    while now_ns < until_ns:
        state, sender = link.receive()
        now_ns = elapsed_ns()
        arrived_ns.append(now_ns)
        states.append(state)
        if command:
            link.answer(state, sender)
    return arrived_ns, states


def _processor_s(process: int) -> float:
    """Return the seconds of processor time that a process has used, all its threads; 0 where there is no ``/proc``."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    return _TICK_S * sum(map(int, text.rpartition(")")[2].split()[11:13]))


if __name__ == "__main__":
    typer.run(main)
