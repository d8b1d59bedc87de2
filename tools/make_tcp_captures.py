"""Records the TCP captures of ``tests/data/tcp`` anew: real sockets on loopback, what their kernel does, by dumpcap.

As root, on Linux: ``python -m tools.make_tcp_captures``. A client asks twenty times.
"""

import shutil
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Final, NamedTuple

FOLDER: Final = Path(__file__).parents[1] / "tests" / "data" / "tcp"
ADDRESS: Final = ("127.0.0.1", 30001)
_EXCHANGES: Final = 20
_SNAP_BYTES: Final = 74
"""Ethernet, IPv4, TCP with the options of a SYN, and nothing of what is said."""


class _Side(NamedTuple):
    """How one side writes what it has to say."""

    pieces: tuple[bytes, ...]
    no_delay: bool


_TALKS: Final = {
    "nagle-request": (_Side((b"jf_0.1_0.2_0.3", b"\n"), no_delay=False), _Side((b"done\n",), no_delay=True)),
    "nagle-reply": (_Side((b"getJointsPositions\n",), no_delay=True), _Side((b"0.1_0.2", b"\n"), no_delay=False)),
    "no-delay": (_Side((b"jf_0.1_0.2_0.3", b"\n"), no_delay=True), _Side((b"done\n",), no_delay=True)),
}


def main() -> None:
    """Record all of them."""
    dumpcap = shutil.which("dumpcap")
    if dumpcap is None:
        sys.exit("dumpcap (part of Wireshark) is not installed")
    for name, (client, server) in _TALKS.items():
        file = FOLDER / f"{name}.pcapng"
        wanted = ("-i", "lo", "-f", f"tcp port {ADDRESS[1]}", "-s", str(_SNAP_BYTES), "-a", "duration:2")
        with subprocess.Popen([dumpcap, "-q", *wanted, "-w", file], stderr=subprocess.PIPE, text=True) as recorder:
            _talk_once_it_records(recorder, client, server)
        file.chmod(0o644)
        print(f"{file}: {file.stat().st_size} bytes")


def _talk_once_it_records(recorder: "subprocess.Popen[str]", client: _Side, server: _Side) -> None:
    for line in recorder.stderr or ():
        if line.startswith("File:"):
            break
    else:
        sys.exit("dumpcap does not record; it needs root")
    with socket.create_server(ADDRESS) as listener:
        answering = threading.Thread(target=_answer, args=(listener, server))
        answering.start()
        with socket.create_connection(ADDRESS) as connection, connection.makefile("rb") as lines:
            _set_up(connection, client)
            for _ in range(_EXCHANGES):
                _write(connection, client)
                lines.readline()
        answering.join()


def _answer(listener: socket.socket, side: _Side) -> None:
    connection, _ = listener.accept()
    with connection, connection.makefile("rb") as lines:
        _set_up(connection, side)
        for _ in lines:
            _write(connection, side)


def _set_up(connection: socket.socket, side: _Side) -> None:
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, side.no_delay)


def _write(connection: socket.socket, side: _Side) -> None:
    for piece in side.pieces:
        connection.sendall(piece)


if __name__ == "__main__":
    main()
