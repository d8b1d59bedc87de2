"""``hil pad`` and its client against ``hil run``, as processes: keys, refusals, holding, watching, what goes wrong."""

import json
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.client.pad import PadClient, PadRefused, RobotState, running_controllers
from hil.client.servo import PTP, Role, ServoClient
from hil.values.errors import EndpointError
from tests.support.cli import cli
from tests.support.processes import ROOT, Ended, finish, hil, own_host, probe, wait_for_line
from tests.support.servo_process import servo_controller

NOT_HELD = "T1: the enabling switch is not held"


@pytest.fixture
def folder() -> Iterator[Path]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="pad") as name:
        yield Path(name)


@contextmanager
def controller(place: Path, *options: object, after: str = "pad: ") -> Iterator["subprocess.Popen[str]"]:
    """Run a controller until the block ends; fail if it does not end in order."""
    process = hil("run", "--fri-client", "off", "--backend", "ideal", "--pad", place, "--progress", 0, *options)
    try:
        wait_for_line(process, after)
        yield process
    finally:
        ended = finish(process, interrupt=True)
    assert ended.code == 0, ended.err
    assert "Traceback" not in ended.err


def pad(place: Path, *arguments: object) -> Ended:
    return finish(hil("pad", *arguments, "--socket", place))


def wait_for(client: PadClient, condition: Callable[[RobotState], bool], *, robot: str = "arm") -> RobotState:
    """Watch until the robot's state is so; pytest's timeout ends what never comes."""
    for robots in client.states():
        if condition(robots[robot]):
            return robots[robot]
    raise AssertionError("the controller closed the connection")


def test_every_key_says_what_became_of_it(folder: Path) -> None:
    place = folder / "x"
    with controller(place, "--mode", "T1"):
        for arguments, code, said in (
            (["start"], 1, f"{NOT_HELD}; hold it first (hil pad enable)"),
            (["reset"], 1, "there is no stop to acknowledge"),
            (["enable"], 0, "arm: T1, PAUSED, enabling held, drives TRANSITIONING, override 100 %; the program is"),
            (["start"], 0, "arm: T1, RUNNING, enabling held, drives "),
            (["override", "50"], 0, "override 50 %"),
            (["override", "150"], 1, "program override 150 is outside its range 0 ... 100 %"),
            (["pause"], 0, "arm: T1, PAUSED"),
            (["release"], 0, "arm: T1, PAUSED, enabling not held, drives OFF"),
            (["mode", "AUT"], 0, "arm: AUT, PAUSED, drives TRANSITIONING"),
            (["start"], 0, "arm: AUT, RUNNING"),
            (
                ["estop"],
                0,
                "arm: AUT, EMERGENCY_STOP, drives OFF, override 50 %; ",
            ),
            (["start"], 1, "the emergency stop was pressed"),
            (["reset"], 0, "arm: AUT, PAUSED, "),
            (["mode", "T2"], 0, "arm: T2, PAUSED, enabling not held, drives OFF"),
        ):
            ended = pad(place, *arguments)
            assert ended.code == code, (arguments, ended)
            assert said in (ended.err if code else ended.out), (arguments, ended)
            assert len((ended.out + ended.err).strip().splitlines()) == 1 + code


def test_inputs_are_set_and_listed(folder: Path) -> None:
    place, station = folder / "x", folder / "station.toml"
    station.write_text(
        """
        [[robot]]
        [[robot.io]]
        name = "G"
        signal = [
            { name = "Key", type = "boolean", direction = "input" },
            { name = "Level", type = "analog", direction = "input", initial = 0.5 },
            { name = "Count", type = "digital", direction = "output", initial = 7 },
        ]
        """,
        encoding="utf-8",
    )
    with controller(place, station):
        for arguments, code, said in (
            (
                ["io"],
                0,
                "arm: G.Key boolean input false\narm: G.Level analog input 0.5\narm: G.Count digital output 7\n",
            ),
            (["io", "G.Count"], 0, "arm: G.Count digital output 7\n"),
            (["io", "G.Key", "true"], 0, "arm: G.Key boolean input true\n"),
            (["io", "G.Level", "-1.5"], 0, "arm: G.Level analog input -1.5\n"),
            (["io", "G.Key"], 0, "arm: G.Key boolean input true\n"),
            (["io", "G.Key", "2"], 1, "G.Key is boolean, 2 is none of its values; valid: true or false"),
            (["io", "G.Count", "1"], 1, "G.Count is an output, which the FRI client sets; inputs: G.Key, G.Level"),
            (["io", "G.Door", "1"], 1, "there is no input 'G.Door'; valid: G.Key, G.Level"),
            (["io", "G.Door"], 1, "there is no input or output 'G.Door'; valid: G.Count, G.Key, G.Level"),
            (["io", "G.Key", "nan"], 2, "'nan' is neither true, false nor a finite number"),
            (["io", "G.Key", "on"], 2, "'on' is neither true, false nor a finite number"),
        ):
            ended = pad(place, *arguments)
            assert ended.code == code, (arguments, ended)
            if code:
                assert said in " ".join(ended.err.replace("│", "").split()), (arguments, ended)
            else:
                assert ended.out == said
        with PadClient(place) as client:
            client.set_input("G.Level", 3)
            assert client.status()["arm"]["io"]["G.Level"] == {
                "type": "analog",
                "direction": "input",
                "value": 3.0,
                "fri": True,
            }


def test_wrong_usage_is_exit_code_2(folder: Path) -> None:
    for arguments in (["mode", "T3"], ["override"], ["override", "half"], ["jump"]):
        ended = cli("pad", *arguments)
        assert ended.code == 2, ended
    nobody = folder / "nobody"
    ended = pad(nobody, "status")
    assert (ended.code, ended.err) == (2, f"hil: no controller at {nobody}: No such file or directory\n")


def test_status_and_screens_say_what_is_permissive(folder: Path) -> None:
    place, status, capture = folder / "x", folder / "status.json", folder / "c.pcapng"
    process = hil(
        "run", "--fri-client", "off", "--backend", "ideal", "--pad", place, "--progress", 0.1, "--mode", "T1",
        "--permissive", "--status-json", status, "--capture", capture,
    )  # fmt: skip
    lines = wait_for_line(process, "late p99")
    assert "arm: PERMISSIVE: the monitors only report, they stop nothing" in lines
    assert any(line.startswith(f"arm: nothing may move: {NOT_HELD}") for line in lines)
    assert f"pad: hil pad finds this controller at {place}" in lines
    assert "| arm | PERMISSIVE | T1 | PAUSED |" in lines[-1]
    table = pad(place, "status").out
    for text in ("PERMISSIVE", "mode", "T1", "PAUSED", "not held", "OFF", "100 %", "SAFETY_STOP_LEVEL_1", "commander",
                 "session", "last stop", "closest margin"):  # fmt: skip
        assert text in table
    told = json.loads(pad(place, "status", "--json").out)["arm"]
    assert (told["program"], told["drives"], told["session"], told["last_stop"]) == ("PAUSED", "OFF", None, None)
    assert (told["permissive"], told["commander"]) == (True, None)
    assert told["cycles"] > 0
    assert "PERMISSIVE" in pad(place, "pause").out
    ended = finish(process, interrupt=True)
    assert ended.code == 0
    assert "arm: PERMISSIVE: the monitors only reported" in ended.out
    assert "PERMISSIVE, T1, PAUSED, override 100 %" in ended.out
    assert b'"permissive":true' in capture.read_bytes()
    report = json.loads(status.read_text())
    assert report["pad"] == {"socket": str(place), "requests": 3, "refused": 0, "lost_lines": 0}


def test_a_controller_that_is_not_permissive_says_nothing_of_it(folder: Path) -> None:
    capture = folder / "c.pcapng"
    process = hil(
        "run", "--fri-client", own_host(), "--backend", "ideal", "--pad", folder / "x", "--duration", 0.5,
        "--progress", 0.1, "--capture", capture,
    )  # fmt: skip
    ended = finish(process)
    assert "PERMISSIVE" not in ended.out + ended.err
    assert "nothing may move" not in ended.err
    assert b'"permissive": true}' not in capture.read_bytes()
    assert "closest margin" in ended.out
    assert "AUT, RUNNING, override 100 %" in ended.out


def test_watching_prints_a_line_for_each_change(folder: Path) -> None:
    place = folder / "x"
    with controller(place, "--mode", "T1"):
        watcher = hil("pad", "watch", "--socket", place)
        assert watcher.stdout is not None
        assert (
            f"arm: T1, PAUSED, enabling not held, drives OFF, override 100 %; {NOT_HELD}" in watcher.stdout.readline()
        )
        with PadClient(place) as client:
            client.enable()
            while "drives ACTIVE" not in (line := watcher.stdout.readline()):
                assert "enabling held" in line
            client.emergency_stop()
            while "EMERGENCY_STOP" not in (line := watcher.stdout.readline()):
                assert line
            assert "last stop " in line
            assert "category 1, the emergency stop was pressed" in line
        ended = finish(watcher, interrupt=True)
        assert (ended.code, ended.err) == (0, "")


def test_watching_ends_with_a_killed_controller(folder: Path) -> None:
    process = hil("run", "--fri-client", "off", "--backend", "ideal", "--pad", folder / "x", "--progress", 0)
    wait_for_line(process, "pad: ")
    watcher = hil("pad", "watch", "--socket", folder / "x")
    assert watcher.stdout is not None
    assert "arm: AUT, RUNNING" in watcher.stdout.readline()
    process.kill()
    finish(process)
    ended = finish(watcher)
    assert (ended.code, ended.err) == (1, "the controller closed the connection\n")


def test_watching_ends_with_the_controller(folder: Path) -> None:
    with controller(folder / "x"):
        watcher = hil("pad", "watch", "--socket", folder / "x")
        assert watcher.stdout is not None
        assert "arm: AUT, RUNNING" in watcher.stdout.readline()
    ended = finish(watcher)
    # It may close the connection before its last line is read.
    assert ended.code == 1
    assert ended.err in {"the controller shuts down\n", "the controller is gone: Broken pipe\n"}


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, None])
def test_a_held_switch_is_let_go_however_the_pad_ends(folder: Path, how: signal.Signals | None) -> None:
    place = folder / "x"
    with controller(place, "--mode", "T1"), PadClient(place) as client:
        holder = hil("pad", "enable", "--hold", "--socket", place, typed=True)
        wait_for_line(holder, "holding the enabling switch until Ctrl-C or the end of the input")
        client.start()
        wait_for(client, lambda state: state["enabling"] and state["drives"] == "ACTIVE")
        if how is None:
            assert holder.stdin is not None
            holder.stdin.close()
            holder.stdin = None
        else:
            holder.send_signal(how)
        state = wait_for(client, lambda state: not state["enabling"] and state["drives"] == "OFF")
        assert (state["program"], state["reason"].startswith(NOT_HELD)) == ("PAUSED", True)
        ended = finish(holder)
        if how in {None, signal.SIGINT}:
            assert (ended.code, ended.err) == (0, "the enabling switch is let go\n")


def test_who_holds_learns_that_another_pad_let_go(folder: Path) -> None:
    place = folder / "x"
    with controller(place, "--mode", "T2"), PadClient(place) as client:
        holder = hil("pad", "enable", "--hold", "--socket", place, typed=True)
        wait_for_line(holder, "holding")
        with pytest.raises(PadRefused, match="another pad holds the enabling switch of arm") as caught:
            client.enable(hold=True)
        assert caught.value.robots["arm"]["enabling"]
        client.release()
        ended = finish(holder)
        assert (ended.code, ended.err) == (1, "the enabling switch was let go by another pad\n")


def test_who_holds_learns_that_the_controller_ended(folder: Path) -> None:
    with controller(folder / "x", "--mode", "T1"):
        holder = hil("pad", "enable", "--hold", "--socket", folder / "x", typed=True)
        wait_for_line(holder, "holding")
    ended = finish(holder)
    # It may close the connection before its last line is read.
    assert ended.code == 1
    assert ended.err in {"the controller shuts down\n", "the controller is gone: Broken pipe\n"}


def test_a_watcher_that_never_reads_holds_up_nobody(folder: Path) -> None:
    place = folder / "x"
    with controller(place), socket.socket(socket.AF_UNIX) as stuck, PadClient(place) as client:
        stuck.connect(str(place))
        stuck.sendall(b'{"do": "watch"}\n' * 3)
        before = client.status()["arm"]
        for number in range(50):
            client.set_override(number)
        after = client.status()["arm"]
        cycles, passed_s = after["cycles"] - before["cycles"], after["time_s"] - before["time_s"]
        # Caught up or not, cycles keep coming; a loop that waits for the watcher makes none.
        assert passed_s > 1.0
        assert cycles > 500 * passed_s


def test_garbage_ends_nothing(folder: Path) -> None:
    place = folder / "x"
    with controller(place), PadClient(place) as client:
        before = client.status()["arm"]["cycles"]
        for garbage in (b"\n\n\n", b"\xff" * 4000 + b"\n", b"[" * 4000 + b"\n", b'{"do": {}}\n', b"x" * 200_000):
            with socket.socket(socket.AF_UNIX) as pest:
                pest.settimeout(10)
                pest.connect(str(place))
                try:
                    pest.sendall(garbage)
                except OSError:
                    continue
                assert json.loads(pest.makefile("rb").readline())["ok"] is False
        wait_for(client, lambda state: state["cycles"] > before + 100)
        assert client.status()["arm"]["program"] == "RUNNING"


def test_two_robots_one_pad(folder: Path) -> None:
    place, station = folder / "x", folder / "two.toml"
    station.write_text("".join(f'[[robot]]\nname = "{name}"\nbackend = "ideal"\n' for name in ("left", "right")))
    process = hil("run", station, "--pad", place, "--progress", 0)
    wait_for_line(process, "pad: ")
    refused = pad(place, "pause")
    assert (refused.code, refused.err) == (
        1, "this controller has 2 robots: say which one (robot); valid: left, right\n"
    )  # fmt: skip
    assert "left: AUT, PAUSED" in pad(place, "pause", "--robot", "left").out
    with PadClient(place, robot="right") as client:
        assert set(client.status()) == {"right"}
        assert client.status()["right"]["program"] == "RUNNING"
    both = pad(place, "estop").out
    assert "left: AUT, EMERGENCY_STOP" in both
    assert "right: AUT, EMERGENCY_STOP" in both
    assert pad(place, "start", "--robot", "up").code == 1
    assert finish(process, interrupt=True).code == 0


def test_the_only_controller_is_found_and_several_are_listed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    run = ("run", "--fri-client", "off", "--servo", "off", "--backend", "ideal", "--progress", 0, "--pad")
    chosen = [argument for argument in run if argument != "--pad"]

    def start() -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli.main", *map(str, chosen)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        )  # fmt: skip
        wait_for_line(process, "pad: ")
        return process

    ended = finish(hil("pad", "status"))
    assert (ended.code, "no controller runs that has its pad in" in ended.err) == (2, True)
    first = start()
    own = folder / "fri-hil" / f"{first.pid}.sock"
    assert stat.S_IMODE(own.stat().st_mode) == 0o600
    assert stat.S_IMODE(own.parent.stat().st_mode) == 0o700
    assert finish(hil("pad", "pause")).out.startswith("arm: AUT, PAUSED")
    second = start()
    ended = finish(hil("pad", "status"))
    assert ended.code == 2
    assert ended.err.startswith("hil: 2 controllers run: ")
    for process in (first, second):
        assert f"/{process.pid}.sock (arm)" in ended.err
    assert [found.robots for found in running_controllers()] == [("arm",), ("arm",)]
    first.kill()
    finish(first)
    assert own.exists()
    assert finish(hil("pad", "start")).code == 0
    third = start()
    assert not own.exists()
    for process in (second, third):
        assert finish(process, interrupt=True).code == 0
    assert list(own.parent.iterdir()) == []


def test_what_cannot_be_a_pad_ends_in_one_sentence(folder: Path) -> None:
    (folder / "fri-hil").mkdir()
    (folder / "fri-hil").chmod(0o755)
    (folder / "file").write_text("precious")
    run = ["run", "--fri-client", "off", "--backend", "ideal", "--duration", 1]
    with controller(folder / "x"):
        for place, sentence in (
            (folder / "x", f"a controller listens at {folder / 'x'} already"),
            (folder / "file", "it is no socket"),
            (folder / ("y" * 120), "a socket's may have"),
        ):
            ended = finish(hil(*run, "--pad", place))
            assert (ended.code, sentence in ended.err) == (2, True), ended
            assert len(ended.err.strip().splitlines()) == 1
        ended = finish(hil("pad", "status", environment={"XDG_RUNTIME_DIR": str(folder)}))
        assert (ended.code, "is open to others (mode 0755" in ended.err) == (2, True)
    assert (folder / "file").read_text() == "precious"


def test_a_pad_can_be_left_out(folder: Path) -> None:
    process = hil(
        "run", "--fri-client", "off", "--backend", "ideal", "--pad", "off", "--mode", "T1", "--duration", 1,
        environment={"XDG_RUNTIME_DIR": str(folder)},
    )  # fmt: skip
    ended = finish(process)
    assert ended.code == 0
    assert "pad: " not in ended.err
    assert "there is no pad to do it with (--pad off)" in ended.err
    assert list(folder.iterdir()) == []


def test_a_silent_controller_is_said_in_words(folder: Path) -> None:
    with socket.socket(socket.AF_UNIX) as silent:
        silent.bind(str(folder / "x"))
        silent.listen()
        with PadClient(folder / "x", timeout_s=0.1) as client, pytest.raises(EndpointError, match="did not answer"):
            client.status()


def test_what_answers_nonsense_is_said_in_words(folder: Path) -> None:
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(folder / "x"))
        other.listen()

        def answer() -> None:
            link, _ = other.accept()
            with link:
                link.recv(1000)
                link.sendall(b"HTTP/1.1 400 Bad Request\n")

        thread = threading.Thread(target=answer)
        thread.start()
        with PadClient(folder / "x") as client, pytest.raises(EndpointError, match="is no controller"):
            client.status()
        thread.join()


def test_a_pad_loads_nothing_heavy() -> None:
    program = """
import sys
from hil.cli.main import main
sys.argv = ["hil", "pad", "status", "--socket", "/nowhere"]
try:
    main()
except SystemExit as ended:
    print(ended.code, *sys.modules)
"""
    told = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, cwd=ROOT
    ).stdout.split()
    assert told[0] == "2"
    assert "hil.client.pad" in told
    assert not {"numpy", "pinocchio", "mujoco", "hil.config", "hil.core", "hil.runtime"} & set(told)


def test_fri_waits_for_the_operator_and_then_commands(folder: Path) -> None:
    host, place, status = own_host(), folder / "x", folder / "status.json"
    client = probe("--release", "1.15", "--bind", host, "--seconds", 30)
    process = hil(
        "run", "--fri-client", host, "--pad", place, "--mode", "T1", "--backend", "ideal", "--send-period", 4,
        "--progress", 0, "--status-json", status,
    )  # fmt: skip
    wait_for_line(process, f"MONITORING_READY, not COMMANDING_WAIT: {NOT_HELD}")
    with PadClient(place) as operator:
        waiting = operator.status()["arm"]
        assert waiting["session"] is not None
        assert waiting["session"]["state"] == "MONITORING_READY"
        operator.enable()
        operator.start()
        wait_for_line(process, "COMMANDING_WAIT -> COMMANDING_ACTIVE")
        operator.release()
        stopped = wait_for(operator, lambda state: state["drives"] == "OFF")
        assert stopped["session"] is not None
        assert stopped["session"]["state"].startswith("MONITORING")
    assert finish(process, interrupt=True).code == 0
    finish(client, interrupt=True)


def test_a_servo_motion_waits_for_the_operator_and_then_moves(folder: Path) -> None:
    place = folder / "x"
    with (
        servo_controller("--pad", place, "--mode", "T1", "--progress", 0) as running,
        ServoClient(running.address) as robot,
        PadClient(place) as operator,
    ):
        here = list(robot.read_state().measured_position)
        there = [*here[:3], here[3] + 0.05, *here[4:]]
        motion = PTP(there)
        robot.move_async(motion)
        assert not motion.wait_until_ended(timeout_s=0.5)
        waiting = wait_for(operator, lambda state: state["commander"] is not None)
        assert waiting["reason"].startswith(NOT_HELD)
        assert robot.read_state().measured_position == pytest.approx(here, abs=1e-9)
        operator.enable(hold=True)
        operator.start()
        assert motion.wait_until_ended(timeout_s=30)
        assert robot.wait_for_state() is not None
        assert robot.read_state().measured_position == pytest.approx(there, abs=1e-3)


def test_a_simulated_arm_is_pushed_and_wrong_pushes_are_refused_in_words(folder: Path) -> None:
    place = folder / "x"
    with (
        servo_controller("--pad", place, "--progress", 0, backend="mujoco") as running,
        ServoClient(running.address, role=Role.OBSERVER) as watcher,
    ):
        for arguments, code, words in (
            (["push", "501", "0", "0"], 1, "force along x 501 is outside its range -500 ... 500 N"),
            (["push", "1", "0", "0", "--link", "8"], 1, "link 8 is outside its range 1 ... 7"),
            (["push", "1", "0"], 2, "takes 3 values"),
            (["push", "0", "0", "-10", "--link", "3", "--moment", "0", "0", "-1"], 0, "arm: AUT, RUNNING"),
            (["push", "0", "-15", "0", "--seconds", "20"], 0, "arm: AUT, RUNNING"),
        ):
            ended = pad(place, *arguments)
            assert ended.code == code, (arguments, ended)
            assert words in ended.out + ended.err, (arguments, ended)
        for snapshot in watcher.states():
            # The observer comes near it within its time of 16 ms, and stays there.
            if snapshot.flange_force[1] < -14.0:
                break
        later = watcher.wait_for_state()
        assert later is not None
        assert later.flange_force[1] == pytest.approx(-15.0, abs=1.5)
