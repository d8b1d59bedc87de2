"""What ``hil top`` shows: every figure is there, nothing is wider or higher than the terminal, peers give no orders."""

import io
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from hil.client.pad import RobotState
from hil.values.arm import Contact
from hil.values.frames import FrameTree
from hil.values.fri import OperationMode
from hil.values.operator import ProgramState
from hil.values.pose import Pose
from hil.values.servo import Snapshot
from tests.unit.test_servo_codec import SNAPSHOT
from tools.view.bars import gauge, mark, sparkline
from tools.view.drawing import ArmNow, DrawnRobot
from tools.view.terminal import Figures, one_line, screen
from tools.view.watch import Latency, Message

DRAWN = DrawnRobot("left", "lbr-iiwa-7-r800", FrameTree(()))
MOVING: Snapshot = SNAPSHOT._replace(
    measured_position=(0.0, 0.5, -2.9, 1.0, -1.0, 1.5, 2.0),
    measured_torque=(0.0, 20.5, -0.04, 150.0, 0.0, 0.0, 0.0),
    external_torque=(0.0, -3.25, 0.0, 0.0, 0.0, 0.0, 0.0),
    flange_in_base=Pose.from_abc_deg((0.5, -0.25, 1.1), 10.0, 20.0, -30.0),
    flange_speed_mm_s=125.0,
    contacts=(Contact((0.5, 0.0, 1.1), (3.0, 0.0, -4.0)), Contact((0.5, 0.0, 1.1), (0.0, 0.0, -1.0))),
)
PAD: RobotState = {
    "mode": "T1",
    "program": "RUNNING",
    "enabling": True,
    "override_percent": 50.0,
    "safety_state": "NORMAL_OPERATION",
    "reason": "",
    "permissive": False,
    "drives": "ACTIVE",
    "session": {"state": "COMMANDING_ACTIVE", "quality": "EXCELLENT"},
    "commander": None,
    "last_stop": None,
    "closest": "",
    "margins": {
        "T1, commanded": {"used": 0.5, "at_s": 1.0, "axis": None},
        "T1, measured": {"used": 0.62, "at_s": 1.0, "axis": None},
    },
    "latency": {"answer_ms": 0.5, "cycle_ms": 0.1},
    "io": {
        "Gripper.Closed": {"type": "boolean", "direction": "input", "value": True, "fri": True},
        "Gripper.Force": {"type": "analog", "direction": "output", "value": 12.5, "fri": True},
    },
    "time_s": 1.0,
    "cycles": 1000,
}
TOO_FAST = "msr T1 illegal speed limit detected: 251.30 mm/s, the limit is 250 mm/s"
SAID = (
    Message("left", 0.5, "AUT, program RUNNING"),
    Message(
        "left", 2.25, "stop of category 1: msr T1 illegal speed limit detected: 251.30 mm/s, the limit is 250 mm/s"
    ),
)


def figures(**changed: Any) -> Figures:
    latencies = tuple(Latency(number * 0.2, 0.1 * number, 0.01) for number in range(20))
    return Figures(DRAWN, "127.0.0.1:30300", ArmNow(MOVING), PAD, SAID, latencies)._replace(**changed)


def drawn(*robots: Figures, width: int = 80, height: int | None = None) -> list[str]:
    console = Console(file=io.StringIO(), width=width, color_system=None, force_terminal=False)
    console.print(screen(robots, width=width, height=height))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_all_figures_of_a_robot_are_there() -> None:
    told = "\n".join(drawn(figures()))
    for what in (
        "left lbr-iiwa-7-r800 127.0.0.1:30300",
        " AUT  PAUSED  enabled  override 50 %",
        "PERMISSIVE",
        "FRI COMMANDING_ACTIVE EXCELLENT",
        "commander grinder  control joint impedance, drives ACTIVE",
        "A2  -120 ",
        "    28.65    20.5     -3.2",
        "  -166.16     0.0      0.0",
        "X    500.0  Y   -250.0  Z   1100.0 mm",
        "A    10.00  B    20.00  C   -30.00 deg",
        "  125 mm/s",
        "most used in T1 62%, margin 38%",
        "touched at 2: 5.0 N at X 500 Y 0 Z 1100 mm",
        "answer 1.90 ms, worst 1.90 ▁",
        " <- Gripper.Closed on -> Gripper.Force 12.5",
        "    2.25 s stop of category 1: msr T1 illegal speed limit detected: 251.30",
        "mm/s, the limit is 250 mm/s",
        "    0.50 s AUT, program RUNNING",
    ):
        assert what in told, what


def test_the_gauge_is_half_full_and_shows_the_most_that_was_used() -> None:
    [line] = [line for line in drawn(figures(), width=64) if "speed, T1 250" in line]
    bar = line.split("250 ")[1].split()[0]
    assert bar.count("█") == pytest.approx(len(bar) / 2, abs=1)
    assert bar.index("┃") == int(0.62 * len(bar))


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize(
    ("width", "height"),
    [
        (1, 24),
        (2, 3),
        (4, 15),
        (9, 24),
        (20, 15),
        (21, 50),
        (41, 24),
        (60, 7),
        (80, 24),
        (131, 3),
        (132, 40),
        (220, 70),
    ],
)
def test_nothing_is_wider_or_higher_than_the_terminal(count: int, width: int, height: int) -> None:
    lines = drawn(*[figures()] * count, width=width, height=height)
    assert all(len(line) <= width for line in lines)
    # Where not even the frames have room, the terminal cuts off the last ones.
    assert len(lines) <= max(height, 3 * count)
    assert sum(line.count("╭") for line in lines) == count or width < len("╭─╮")


def test_robots_stand_side_by_side_where_there_is_room() -> None:
    for width, beside in ((140, 2), (120, 1)):
        assert drawn(figures(), figures(), width=width, height=30)[0].count("╭") == beside


def test_what_matters_least_gives_way_first() -> None:
    told = "\n".join(drawn(figures(), height=15))
    assert "A7" in told
    assert "mm/s" in told
    assert "Gripper" not in told
    assert "0.50 s" not in told


def test_without_a_pad_it_says_what_is_not_known() -> None:
    told = "\n".join(drawn(figures(pad=None, latencies=(), messages=())))
    assert "FRI not known without the controller's pad" in told
    assert "latency not known without the controller's pad" in told
    assert "A7" in told


def test_a_lost_robot_says_why_above_what_was_seen_last() -> None:
    lost = figures(now=ArmNow(MOVING, "no state came for 0.5 s"), pad=None)
    lines = drawn(lost)
    assert "LOST: no state came for 0.5 s" in lines[1]
    assert any("A7" in line for line in lines)
    assert "LOST: no state came for 0.5 s" in one_line(lost)
    assert one_line(figures(now=ArmNow(None, "gone"))) == "left: LOST: gone"
    assert "LOST: gone" in drawn(figures(now=ArmNow(None, "gone")))[1]


def test_what_is_said_again_and_again_is_said_once() -> None:
    again = tuple(Message("", float(number), "no controller at /x") for number in range(20))
    lines = drawn(figures(messages=(*SAID, *again)))
    assert sum("no controller at /x" in line for line in lines) == 1
    assert any("   19.00 s no controller" in line for line in lines)
    assert any("stop of category 1" in line for line in lines)


def test_peers_give_the_terminal_no_orders_and_no_markup() -> None:
    rude = "\x1b[2J[red]mover[/red]\x07\n"
    snapshot = MOVING._replace(commander=rude, operator=MOVING.operator._replace(reason=rude))
    robot = figures(
        now=ArmNow(snapshot), drawn=DRAWN._replace(name=rude), messages=(Message("left", 1.0, rude),), address=rude
    )
    told = "\n".join(drawn(robot, width=120))
    assert "\x1b" not in told + one_line(robot)
    assert "\x07" not in told + one_line(robot)
    assert told.count("[red]mover[/red]") == 5
    assert "\n" not in one_line(robot)


def test_a_line_for_what_is_no_terminal() -> None:
    running = MOVING.operator._replace(mode=OperationMode.T1, program=ProgramState.RUNNING, reason="", permissive=False)
    assert one_line(figures(now=ArmNow(MOVING._replace(operator=running)))) == (
        "[    0.001 s] left: T1 RUNNING | enabled, override 50 % | FRI COMMANDING_ACTIVE EXCELLENT | "
        "commanded by grinder | axes 0.00 28.65 -166.16 57.30 -57.30 85.94 114.59 deg | "
        "flange 500.0 -250.0 1100.0 mm, 10.00 20.00 -30.00 deg, 125 mm/s"
    )


@given(
    share=st.floats(),
    most=st.floats(),
    width=st.integers(-3, 60),
    values=st.lists(st.floats(0.0, 1e6), max_size=400),
)
def test_bars_have_the_width_they_are_told(share: float, most: float, width: int, values: list[float]) -> None:
    """Invariant: any figures, also what is none, make a bar of that many characters."""
    assert len(mark(share, width)) == max(width, 0)
    assert len(gauge(share, width, most=most)) == max(width, 0)
    assert len(sparkline(values, width)) == min(len(values), max(width, 0))


def test_bars() -> None:
    assert mark(0.5, 7) == "───█───"
    assert mark(0.0, 7) == mark(-1.0, 7) == "█──┼───"
    assert mark(1.0, 7) == mark(2.0, 7) == "───┼──█"
    assert mark(0.499999, 8) == "───█─── "
    assert gauge(0.5, 4) == "██░░"
    assert gauge(0.25, 4, most=0.75) == "█░░┃"
    assert gauge(2.0, 4, most=1.01) == "███┃"
    assert sparkline([0.0, 1.0, 2.0], 10) == "▁▅█"
    assert sparkline([0.0, 1.0, 2.0, 1.0], 2) == "▅█"
    assert sparkline([0.0, 0.0], 5) == "▁▁"
