"""The KST server's process: ``python -m hil.runtime.kst_main LISTENER_FD JSON``.

It serves until its standard input ends, by order or by the controller's death. It writes lines of JSON: what is to be
said, and, every half second in which something changed and at the end, what it did.
"""

import asyncio
import gc
import json
import os
import socket
import sys
from pathlib import Path
from typing import Any, Final

from hil.arithmetic import fix_arithmetic
from hil.clock import MonotonicClock
from hil.kst.robot import Robot, client_factory
from hil.kst.server import KstServer
from hil.values.kst import KstSettings, UnprovenLoad
from transport.servo import load_key

REPORT_S: Final = 0.5


def main() -> None:
    """Serve, and report."""
    fix_arithmetic()
    descriptor, wishes = int(sys.argv[1]), json.loads(sys.argv[2])
    listener = socket.socket(fileno=descriptor)
    listener.setblocking(False)
    # A look through all that was imported would cost 20 ms, in which no set-point is answered.
    gc.freeze()
    asyncio.run(_serve(listener, wishes))


async def _serve(listener: socket.socket, wishes: dict[str, Any]) -> None:
    key = None if wishes["key_file"] is None else load_key(Path(wishes["key_file"]))
    make_client = client_factory(wishes["controller"], state_period_ms=wishes["state_period_ms"], key=key)
    server = KstServer(
        listener,
        settings=settings_of(wishes["settings"]),
        make_robot=lambda tell: Robot(make_client, tell=tell),
        clock=MonotonicClock(),
        tell=lambda sentence: _write({"say": sentence}),
    )
    loop = asyncio.get_running_loop()
    loop.add_reader(sys.stdin.fileno(), _ends, server)
    reports = loop.create_task(_report(server))
    try:
        await server.serve()
    finally:
        loop.remove_reader(sys.stdin.fileno())
        reports.cancel()
        await asyncio.gather(reports, return_exceptions=True)
        _write({"report": server.report()})


def settings_of(content: dict[str, Any]) -> KstSettings:
    """Return the settings of JSON."""
    return KstSettings(
        position_min_rad=tuple(content["position_min_rad"]),
        position_max_rad=tuple(content["position_max_rad"]),
        velocity_max_rad_s=tuple(content["velocity_max_rad_s"]),
        strict=content["strict"],
        nagle=content["nagle"],
        watchdog_ms=content["watchdog_ms"],
        unproven_load=UnprovenLoad(content["unproven_load"]),
        second_acknowledgement=content["second_acknowledgement"],
    )


async def _report(server: KstServer) -> None:
    told: object = None
    never = asyncio.Event()
    while True:
        try:
            async with asyncio.timeout(REPORT_S):
                await never.wait()
        except TimeoutError:
            report = server.report()
            if report != told:
                told = report
                _write({"report": report})


def _ends(server: KstServer) -> None:
    if not os.read(sys.stdin.fileno(), 4096):
        # Its end can be read for ever.
        asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        server.stop()


def _write(message: dict[str, object]) -> None:
    try:
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        # The controller died: standard input tells that too, and ends this process. Nobody is left to be told.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
