"""Applications that are killed at a random moment at full speed, as real processes: the arm stands within its time."""

import itertools
import json
import random
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from backends.robots import load_description
from hil.client.servo import PTP, Role, ServoClient, Snapshot
from tests.support.processes import ROOT
from tests.support.servo_process import servo_controller

WATCHDOG_MS = 120
KILLS = 3
LIMITS = load_description("lbr-iiwa-14-r820").limits
APPLICATION = """
import sys
from hil.client.servo import PTP, ServoClient

with ServoClient(sys.argv[1], name="crashing", watchdog_ms=int(sys.argv[2])) as robot:
    start = robot.read_state().commanded_position
    print("moves", flush=True)
    for turn in range(1000):
        robot.move(PTP((0.9 if turn % 2 else -0.9, *start[1:])))
"""


def braking_s(velocity: float, axis: int) -> float:
    """Time an axis needs to stop with its rated acceleration and jerk."""
    acceleration, jerk = LIMITS.acceleration_rad_s2[axis], LIMITS.jerk_rad_s3[axis]
    return velocity / acceleration + 2 * acceleration / jerk


def speed(before: Snapshot, after: Snapshot) -> float:
    return abs(after.commanded_position[0] - before.commanded_position[0]) / ((after.now_ns - before.now_ns) * 1e-9)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("backend", ["ideal", "mujoco"])
def test_a_killed_application_leaves_an_arm_at_rest(backend: str, tmp_path: Path) -> None:
    rng = random.Random(backend)
    status = tmp_path / "status.json"
    with servo_controller("--status-json", status, backend=backend) as controller:
        with ServoClient(
            controller.address, role=Role.OBSERVER, watchdog_ms=10_000, state_period_ms=1, name="watching"
        ) as observer:
            for _ in range(KILLS):
                killed_at_ns, seen = killed(controller.address, observer, after_s=rng.uniform(0.0, 0.6))
                stands(seen, killed_at_ns)
        with ServoClient(controller.address, name="next") as robot:
            robot.move(PTP(robot.read_state().commanded_position))
    arm = json.loads(status.read_text())["robots"]["arm"]
    assert arm["servo"]["sessions_begun"] == KILLS + 2
    for stop in arm["stops"]:
        assert re.match(
            rf"the application left: silent for \d+ ms, the watchdog allows {WATCHDOG_MS} ms \(\d+\.\d ms too long\)",
            stop["reason"],
        ), stop
    assert len(arm["stops"]) == KILLS


def killed(address: str, observer: ServoClient, *, after_s: float) -> tuple[int, list[Snapshot]]:
    """Start an application, kill it at full speed, and return what an observer saw from shortly before that on."""
    process = subprocess.Popen(
        [sys.executable, "-c", APPLICATION, address, str(WATCHDOG_MS)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "moves\n"
    fast = 0.9 * LIMITS.velocity_rad_s[0]
    not_before_ns = observer.read_state().now_ns + int(after_s * 1e9)
    for before, after in itertools.pairwise(observer.states()):
        if after.now_ns > not_before_ns and after.now_ns > before.now_ns and speed(before, after) > fast:
            break
    process.send_signal(signal.SIGKILL)
    process.communicate()
    latest = observer.read_state()
    seen = [latest]
    for snapshot in observer.states():
        if snapshot.now_ns > seen[-1].now_ns:
            seen.append(snapshot)
        if snapshot.now_ns > latest.now_ns + 1_500_000_000:
            break
    return latest.now_ns, seen


def stands(seen: list[Snapshot], killed_at_ns: int) -> None:
    """The set point never jumps, and stands still within watchdog plus braking time."""
    for before, after in itertools.pairwise(seen):
        for axis, fastest in enumerate(LIMITS.velocity_rad_s):
            step = abs(after.commanded_position[axis] - before.commanded_position[axis])
            # The clock of the states counts cycles, so this holds whatever was lost on the way.
            assert step <= fastest * (after.now_ns - before.now_ns) * 1e-9 * (1 + 1e-6)
    last = next(
        after.now_ns
        for before, after in reversed(list(itertools.pairwise(seen)))
        if before.commanded_position != after.commanded_position
    )
    needed_s = (last - killed_at_ns) * 1e-9
    # 50 ms: what passed between the kill and the state that was read after it, and states that were lost.
    assert needed_s <= WATCHDOG_MS * 1e-3 + braking_s(LIMITS.velocity_rad_s[0], 0) + 0.05, needed_s
    assert not seen[-1].commander
    assert not seen[-1].motions
