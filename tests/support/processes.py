"""Real processes of ours and the independent probe, each on a loopback address of its own."""

import itertools
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PROBE = ROOT.parent / "shared" / "tools" / "fri_probe.py"
WARNINGS = {"PYTHONWARNINGS": "error::ResourceWarning"}
"""For processes and for those they start themselves: what was not closed is told, and :func:`finish` looks for it."""
_hosts = itertools.count(10)


def own_host() -> str:
    """Return a loopback address that no other test of this run uses."""
    number = next(_hosts)
    return f"127.{1 + os.getpid() % 250}.{number // 250}.{number % 250 + 2}"


def hil(
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    typed: bool = False,
    station_links: bool = False,
) -> "subprocess.Popen[str]":
    """Start the command line, with ``environment`` laid over ours; ``typed``: its input lasts until it is closed.

    ``hil run`` without a servo link, whose default port all share, and without a pad, unless asked for one; with
    ``station_links`` the links are those of the station file.
    """
    if arguments[0] == "run" and not station_links:
        for link in ("--servo", "--pad"):
            arguments = arguments if link in arguments else (*arguments, link, "off")
    return subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", *map(str, arguments)],
        stdin=subprocess.PIPE if typed else subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, **WARNINGS, **(environment or {})},
    )


def probe(*arguments: object) -> "subprocess.Popen[str]":
    """Start the independent client."""
    return subprocess.Popen(
        [sys.executable, str(PROBE), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@dataclass
class Ended:
    """What a process left."""

    code: int
    out: str
    err: str


def finish(process: "subprocess.Popen[str]", *, timeout_s: float = 40.0, interrupt: bool = False) -> Ended:
    """Wait for the end, after SIGINT if asked to."""
    if interrupt:
        process.send_signal(signal.SIGINT)
    try:
        out, err = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        raise AssertionError(f"{process.args!r} did not end\n{out}\n{err}") from None
    assert "ResourceWarning" not in (err or ""), err
    return Ended(process.returncode, out, err)


def wait_for_line(process: "subprocess.Popen[str]", text: str) -> list[str]:
    """Read the process's standard error until a line holds ``text``; return the lines."""
    assert process.stderr is not None
    lines: list[str] = []
    for line in process.stderr:
        lines.append(line.rstrip())
        if text in line:
            return lines
    raise AssertionError(f"{text!r} never came:\n" + "\n".join(lines))


def run_with_probe(
    folder: Path, release: str, *, seconds: float = 4.0, run: Sequence[object] = (), probing: Sequence[object] = ()
) -> tuple[dict[str, Any], dict[str, Any], str]:
    """Run controller and probe together; return the probe's findings, the status file and the controller's lines."""
    host, status = own_host(), folder / "status.json"
    client = probe("--release", release, "--bind", host, "--port", 30200, "--seconds", seconds + 5, *probing)
    controller = hil(
        "run", "--fri-client", f"{host}:30200", "--fri-version", release, "--duration", seconds,
        "--status-json", status, *run,
    )  # fmt: skip
    ended = finish(controller)
    found = json.loads(finish(client).out)
    assert ended.code == 0, ended.err
    return found, json.loads(status.read_text()), ended.err
