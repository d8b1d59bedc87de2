"""Applications as processes of their own against ``hil run``: samples, crashes, keys, a port in use."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.client.servo import (
    PTP,
    ControllerSilent,
    Role,
    ServoClient,
    SessionRefused,
    SmartServo,
    load_key,
)
from tests.support.cli import cli
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line
from tests.support.servo_process import servo_controller

pytestmark = pytest.mark.alone

STATISTICS = r"n\((\d+)\) T\(\d+\.\d\d, \d+\.\d\d, \d+\.\d\d msec\) \(stdDev \d+\.\d\d\)"
PNG = b"\x89PNG"


def application(name: str, *arguments: object) -> "subprocess.Popen[str]":
    """Start a sample application."""
    return subprocess.Popen(
        [sys.executable, "-m", f"apps.{name}", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


@pytest.mark.parametrize("name", ["smart_servo_joint_motion", "direct_servo_joint_motion"])
def test_the_sample_moves_the_mujoco_arm_and_prints_the_manuals_statistics(name: str, tmp_path: Path) -> None:
    picture, figures, status = tmp_path / "motion.png", tmp_path / "figures.json", tmp_path / "status.json"
    with servo_controller("--status-json", status, backend="mujoco") as controller:
        ended = finish(
            application(
                name,
                "--controller",
                controller.address,
                "--seconds",
                2,
                "--frequency",
                0.5,
                "--plot",
                picture,
                "--json",
                figures,
            )
        )
    assert ended.code == 0, ended.err
    assert re.search(f"^Statistic Timing of Overall Loop {STATISTICS}$", ended.out, re.MULTILINE), ended.out
    assert re.search(f"^timing update Controller {STATISTICS}$", ended.out, re.MULTILINE), ended.out
    assert re.search(f"^timing SetDestination {STATISTICS}$", ended.out, re.MULTILINE), ended.out
    assert picture.read_bytes().startswith(PNG)
    found = json.loads(figures.read_text())
    assert found["peak_rad"] == pytest.approx(0.3, abs=0.05)
    robot = json.loads(status.read_text())["robots"]["arm"]
    assert robot["servo"]["sessions_begun"] == 1
    assert robot["servo"]["motions_begun"] == 2
    assert robot["servo"]["requests_refused"] == 0
    assert robot["stops"] == []


CELL = """
[[robot]]
model = "lbr-iiwa-7-r800"
[robot.servo]
[robot.base]
z_mm = 800.0
a_deg = 90.0
[[robot.frame]]
name = "table"
x_mm = 500.0
z_mm = 100.0
a_deg = 30.0
c_deg = 180.0
[[robot.tool]]
name = "gripper"
z_mm = 45.0
mass_kg = 1.5
[[robot.tool.frame]]
name = "tip"
x_mm = 30.0
z_mm = 150.0
"""
"""A station with a tool, a reference frame that is upside down and turned, and a base above the world."""


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """The station file of the cell."""
    file = tmp_path / "cell.toml"
    file.write_text(CELL)
    return file


@pytest.mark.parametrize(
    ("name", "in_cell", "frame", "reference", "along"),
    [
        ("smart_servo_cartesian", False, "flange", "base", "z"),
        ("direct_servo_cartesian", True, "tip", "table", "y"),
        ("smart_servo_cartesian", True, "gripper", "world", "x"),
    ],
)
def test_the_cartesian_sample_moves_its_frame_and_draws_it(  # noqa: PLR0917  # parameters of the test
    name: str, in_cell: bool, frame: str, reference: str, along: str, cell: Path, tmp_path: Path
) -> None:
    picture, figures, status = tmp_path / "motion.png", tmp_path / "figures.json", tmp_path / "status.json"
    station = (cell,) if in_cell else ()
    with servo_controller(*station, "--status-json", status, backend="mujoco") as controller:
        options = ("--seconds", 2, "--frequency", 0.5, "--along", along, "--plot", picture, "--json", figures)
        frames = ("--frame", frame, "--reference", reference) if in_cell else ()
        ended = finish(application(name, "--controller", controller.address, *options, *frames))
        with ServoClient(controller.address, role=Role.OBSERVER) as observer:
            assert ("table" in observer.frames) is in_cell
    assert ended.code == 0, ended.err
    assert re.search(f"^Statistic Timing of Overall Loop {STATISTICS}$", ended.out, re.MULTILINE), ended.out
    assert re.search(f"^timing SetDestination {STATISTICS}$", ended.out, re.MULTILINE), ended.out
    assert f"{along} of {frame} in {reference} moved by " in ended.out
    assert picture.read_bytes().startswith(PNG)
    found = json.loads(figures.read_text())
    assert found["peak_m"] == pytest.approx(0.04, abs=0.004)
    robot = json.loads(status.read_text())["robots"]
    [arm] = robot.values()
    assert arm["servo"]["motions_begun"] == 2
    assert arm["servo"]["requests_refused"] == 0
    assert arm["stops"] == []


def test_checking_a_station_names_its_frames(cell: Path) -> None:
    ended = finish(hil("config", "check", cell))
    assert ended.code == 0, ended.err
    words = re.sub(r"[\s│]+", " ", ended.out)
    assert "frames still: world, base, table; moving: flange, gripper, tip" in words
    cell.write_text(CELL.replace('name = "tip"', 'name = "tip"\nparent = "table"'))
    ended = finish(hil("config", "check", cell))
    assert ended.code == 2
    assert "the frame 'tip' (TOOL_FRAME) cannot hang below 'table' (REFERENCE)" in ended.err


@pytest.mark.parametrize("name", ["smart_servo_cartesian", "direct_servo_cartesian"])
def test_a_cartesian_sample_with_frames_that_do_not_fit_says_so_in_the_manuals_words(name: str, cell: Path) -> None:
    on_flange = "frameOnFlange is not frame below or equal to the flange of this robot"
    static = "base is not static relative to the base of this robot"
    with servo_controller(cell) as controller:
        for options, text, why in (
            (("--frame", "table"), on_flange, "'table' stands still in the base"),
            (("--frame", "grinder"), on_flange, "unknown frame 'grinder'; valid: world, base, flange, table, gripper"),
            (("--reference", "tip"), static, "'tip' moves with the flange"),
            (("--reference", "flange"), static, "'flange' moves with the flange"),
        ):
            ended = finish(application(name, "--controller", controller.address, "--seconds", 1, *options))
            assert ended.code == 2
            said, note = ended.err.strip().splitlines()
            assert said == f"{name}: {text}"
            assert why in note
        wrong = finish(application(name, "--controller", controller.address, "--along", "a"))
        assert wrong.code == 2
        assert "'a' is no coordinate; valid: x, y, z" in re.sub(r"[\s│]+", " ", wrong.err)
        with ServoClient(controller.address) as robot:
            assert robot.read_state().motions == ()


def test_a_sample_without_a_controller_says_what_to_check() -> None:
    ended = finish(application("smart_servo_joint_motion", "--controller", f"{own_host()}:30301"))
    assert ended.code == 2
    assert ended.err.startswith("smart_servo_joint_motion: ")
    assert "30301" in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_a_killed_application_loses_the_arm_and_the_next_one_gets_in(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    with servo_controller("--status-json", status, backend="mujoco") as controller:
        with ServoClient(controller.address, role=Role.OBSERVER, watchdog_ms=2000) as observer:
            crashing = application(
                "smart_servo_joint_motion", "--controller", controller.address, "--seconds", 30, "--amplitude", 1.0
            )
            for snapshot in observer.states():
                if snapshot.motions and snapshot.motions[0].executed > 40:
                    break
            crashing.send_signal(signal.SIGKILL)
            crashing.communicate()
            for snapshot in observer.states():
                if not snapshot.commander:
                    break
            assert snapshot.motions == ()
        with ServoClient(controller.address, name="next") as robot:
            home = robot.read_state().commanded_position
            robot.move(PTP(home))
            assert (
                max(abs(there - here) for there, here in zip(robot.read_state().measured_position, home, strict=True))
                < 0.02
            )
    [stop] = json.loads(status.read_text())["robots"]["arm"]["stops"]
    assert re.match(r"the application left: silent for \d+ ms, the watchdog allows 300 ms", stop["reason"]), stop


def test_an_application_that_raises_leaves_at_once() -> None:
    with servo_controller() as controller:

        def fail() -> None:
            with ServoClient(controller.address, watchdog_ms=5000) as robot:
                motion = SmartServo()
                robot.move_async(motion)
                motion.get_runtime()
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            fail()
        with ServoClient(controller.address, connect_timeout_s=1.0) as robot:
            assert robot.read_state().motions == ()


def test_one_commander_and_observers(tmp_path: Path) -> None:
    with servo_controller() as controller:
        with (
            ServoClient(controller.address, name="first") as robot,
            ServoClient(controller.address, role=Role.OBSERVER, name="watcher") as observer,
        ):
            second = ServoClient(controller.address, name="second", connect_timeout_s=0.3)
            with pytest.raises(SessionRefused, match="the arm is commanded by first at "):
                second.connect()
            motion = SmartServo()
            robot.move_async(motion)
            motion.get_runtime()
            seen = observer.wait_for_state()
            assert seen is not None
            assert seen.commander.startswith("first at ")
        with ServoClient(controller.address, name="second") as robot:
            assert robot.commander.startswith("second at ")


def test_a_key_lets_in_who_has_it_and_nobody_else(tmp_path: Path) -> None:
    key, other = tmp_path / "servo.key", tmp_path / "other.key"
    for file in (key, other):
        assert finish(hil("config", "key", file)).code == 0
        assert file.stat().st_mode & 0o077 == 0
    again = finish(hil("config", "key", key))
    assert again.code == 2
    with servo_controller("--servo-key", key) as controller:
        with ServoClient(controller.address, key=load_key(key)) as robot:
            robot.move_async(SmartServo())
        for wrong in (None, load_key(other)):
            with pytest.raises(ControllerSilent, match="key"):
                ServoClient(controller.address, key=wrong, connect_timeout_s=0.3).connect()


def test_a_second_controller_on_the_same_port_says_so() -> None:
    with servo_controller() as controller:
        ended = finish(hil("run", "--fri-client", own_host(), "--servo", controller.address, "--duration", 1))
    assert ended.code == 2
    assert f"cannot bind UDP {controller.address}" in ended.err
    assert "--servo" in ended.err
    assert len(ended.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--servo", "127.0.0.1:none"], "the port 'none' is no number"),
        (["--servo", "off", "--servo-key", "x"], "--servo off leaves nothing for --servo-key to protect"),
        (["--servo", "127.0.0.1:0", "--servo-key", "/nowhere/x"], "/nowhere/x"),
        (["--servo", "127.0.0.1:0", "--reaction", "slow"], "slow"),
    ],
)
def test_options_that_cannot_work_are_refused_in_words(arguments: list[str], sentence: str) -> None:
    ended = cli("run", "--fri-client", own_host(), *arguments, "--duration", 1)
    assert ended.code == 2
    assert sentence in ended.err
    assert "Traceback" not in ended.err


STATION = """
[[robot]]
[robot.servo]
bind = "{bind}"
[[robot.tool]]
name = "gripper"
mass_kg = 1.0
centre_mm = [0.0, 0.0, 40.0]
mounted = true
[[robot.tool.frame]]
name = "tip"
z_mm = 120.0
"""


@contextmanager
def station(tmp_path: Path) -> Iterator[str]:
    """Run a controller with a tool and a table; yield where its applications connect."""
    file = tmp_path / "station.toml"
    bind = f"{own_host()}:0"
    file.write_text(STATION.format(bind=bind), encoding="utf-8")
    process = hil("run", file, "--pad", "off", "--servo", bind)
    lines = wait_for_line(process, "applications at ")
    found = re.search(r"applications at (\S+),", lines[-1])
    assert found is not None, lines
    try:
        yield found[1]
    finally:
        process.send_signal(signal.SIGINT)
        ended = finish(process)
        assert ended.code == 0, ended.err


@pytest.mark.parametrize("name", ["smart_servo_interaction_control", "direct_servo_interaction_control"])
def test_the_interaction_samples_give_way_by_force_over_stiffness(name: str, tmp_path: Path) -> None:
    picture, figures = tmp_path / "motion.png", tmp_path / "figures.json"
    with station(tmp_path) as address:
        arguments = ("--controller", address, "--frame", "tip", "--seconds", 6)
        ended = finish(application(name, *arguments, "--plot", picture, "--json", figures))
        without_tool = finish(application(name, "--controller", address, "--frame", "flange"))
    assert ended.code == 0, ended.err
    assert "now under JOINT_IMPEDANCE" in ended.out
    soft, *_, stiff = json.loads(figures.read_text())["deflection_mm"]
    assert soft - stiff == pytest.approx(1e3 * 15.0 * (1 / 500 - 1 / 2000), rel=0.05)
    assert picture.read_bytes().startswith(PNG)
    assert without_tool.code == 2
    assert "Validation of Torque Model failed: the load of 0 kg that was told" in without_tool.err


def test_an_unstable_visual_servoing_ends_itself_and_the_controller_says_why(tmp_path: Path) -> None:
    picture, figures = tmp_path / "loop.png", tmp_path / "figures.json"
    with servo_controller() as controller:
        options = ("--gain", 1.5, "--target", 0.08, "--seconds", 10, "--plot", picture, "--json", figures)
        ended = finish(application("visual_servoing", "--controller", controller.address, *options))
    assert ended.code == 0, ended.err
    stopped = "stopped: the loop is unstable with the gain 1.5, where below 1 is stable (manual 7.11): "
    assert ended.out.splitlines()[-1].startswith(stopped), ended.out
    assert picture.read_bytes().startswith(PNG)
    found = json.loads(figures.read_text())
    assert found["stopped"] is True
    assert found["growth"] == pytest.approx(2.25, rel=0.25)
    assert controller.ended is not None
    sentence = (
        r"arm: A1 oscillates at \d\.\d+ Hz and grows by \d\.\d\d a period: the application's loop is unstable "
        r"\(feedback effect, manual 7\.11\); its gain is about 1\.\d\d where below 1 is stable"
    )
    assert re.search(sentence + "; what helps: in the application: check the control law", controller.ended.err)
    assert re.search(sentence, controller.ended.out)
    assert "2. lower the program override, now 100 %" in controller.ended.out
