"""Processes that a benchmark has beside it do not outlive it, however it ends."""

import os
import select
import subprocess
import sys

import pytest

STARTER = (
    "import os, subprocess, sys\n"
    "child = subprocess.Popen([sys.executable, '-m', sys.argv[1], str(os.getpid()), *sys.argv[2:]])\n"
    "print(child.pid, flush=True)\n"
    "sys.stdin.readline()\n"
)


@pytest.mark.parametrize("arguments", [("tools.bench.burn", "0"), ("tools.bench.answering", "127.0.0.1", "0")])
def test_they_end_with_who_started_them(arguments: tuple[str, ...]) -> None:
    starter = subprocess.Popen(
        [sys.executable, "-c", STARTER, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with starter:
        assert starter.stdout is not None
        child = int(starter.stdout.readline())
        descriptor = os.pidfd_open(child)
        starter.kill()
    try:
        assert select.select([descriptor], [], [], 10.0)[0], "it burns on, with nobody to end it"
    finally:
        os.close(descriptor)
