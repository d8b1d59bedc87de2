"""Recordings of real processes, replayed; captures begun and ended on the way; stand-ins for either side."""

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hil.client.pad import PadClient
from hil.client.servo import ServoClient, SmartServo
from hil.config.station import RobotConfig
from hil.replay.replay import replay_file
from hil.testkit import VirtualController
from tests.support.cli import cli
from tests.support.processes import ROOT, Ended, finish, hil, own_host, wait_for_line
from tests.support.recordings import flip_bit, header_of, packets, records
from transport.capture.records import Notes

DATA = Path(__file__).parents[1] / "data"
RECORDED = DATA / "fri-1.15-joint-position-5ms.pcapng"


@pytest.fixture
def folder() -> Iterator[Path]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="rep") as name:
        yield Path(name)


def program(module: str, *arguments: object) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", module, *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def until(pad: PadClient, state: str, *, robot: str = "arm") -> None:
    """Watch until the robot's session is in ``state``; pytest's timeout ends what never comes."""
    for robots in pad.states():
        session = robots[robot]["session"]
        if session is not None and session["state"] == state:
            return


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two robots: a sine of an FRI client, an application, and an operator who stops and pushes."""
    folder = tmp_path_factory.mktemp("run")
    file, host = folder / "run.pcapng", own_host()
    station = folder / "station.toml"
    station.write_text(
        f"""
        capture = "{file}"
        [[robot]]
        name = "arm"
        [robot.fri]
        client = "{host}:30200"
        send_period_ms = 20
        [[robot]]
        name = "other"
        seed = 4
        [robot.servo]
        bind = "{host}:30300"
        """,
        encoding="utf-8",
    )
    with tempfile.TemporaryDirectory(prefix="rep") as place:
        # Not by hil(), which takes servo links away that a test did not ask for by option.
        controller = program("hil.cli.main", "run", station, "--pad", f"{place}/x", "--status-json", folder / "s.json")
        client = program("apps.fri_joint_sine", "--bind", host, "--seconds", 20, "--fri-version", "1.15")
        try:
            wait_for_line(controller, "pad: ")
            with PadClient(f"{place}/x") as pad, ServoClient(f"{host}:30300") as robot:
                start = robot.read_state().measured_position
                motion = SmartServo()
                robot.move_async(motion)
                motion.get_runtime().set_destination((*start[:6], start[6] + 0.2))
                until(pad, "COMMANDING_ACTIVE")
                motion.get_runtime().stop_motion()
            with PadClient(f"{place}/x", robot="arm") as pad:
                pad.push((15.0, 0.0, 0.0), duration_s=0.2)
                pad.set_override(50.0)
                pad.emergency_stop()
                pad.reset()
        finally:
            ended = finish(controller, interrupt=True)
            client.terminate()
            client.communicate()
    assert ended.code == 0, ended.err
    status = json.loads((folder / "s.json").read_text())
    assert status["capture"]["error"] is None
    assert status["capture"]["dropped"] == 0
    assert status["capture"]["written"] == len(packets(file))
    return file


def replayed(*arguments: object) -> tuple[Ended, dict[str, Any]]:
    ended = cli("replay", *arguments, "--json", "-")
    return ended, json.loads(ended.out) if ended.out else {}


def test_a_run_of_real_processes_replays_byte_for_byte(run: Path) -> None:
    ended, found = replayed(run)
    assert found["verdict"].startswith("identical byte for byte"), found["verdict"]
    assert (ended.code, ended.err) == (0, "")
    assert found["complete"]
    assert found["notes"] == []
    assert found["inputs"] > 60
    assert found["compared"] + found["inputs"] == len(packets(run))
    header = header_of(run)
    assert [robot.name for robot in header.robots] == ["arm", "other"]
    assert header.config(1).seed == 4


def test_what_was_changed_is_told_with_exit_code_1(run: Path, tmp_path: Path) -> None:
    file = tmp_path / "changed.pcapng"
    file.write_bytes(run.read_bytes())
    bound = header_of(run).robots[0].bound["fri"]
    commands = [one for one in packets(run) if one.destination == bound]
    flip_bit(file, commands[50], len(commands[50].payload) - 3, 6)
    ended = cli("replay", file)
    assert ended.code == 1
    assert "changed after it was recorded:" in ended.out
    assert f"packet {commands[50].number}," in " ".join(ended.out.split())
    assert f"bit 6 of byte {len(commands[50].payload) - 3}" in " ".join(ended.out.split())


def test_a_damaged_file_ends_with_exit_code_2_and_the_offset(run: Path, tmp_path: Path) -> None:
    file = tmp_path / "cut.pcapng"
    file.write_bytes(run.read_bytes()[:-1000])
    ended = cli("replay", file)
    assert ended.code == 2
    assert "identical byte for byte" in ended.out
    assert f"capture {file} at byte " in " ".join(ended.out.split()).replace("\n", "")


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "cannot be read: No such file"), (b"", "the file is empty"), (b"PK\x03\x04" * 9, "not a pcapng file")],
)
def test_what_is_no_capture_is_one_sentence(tmp_path: Path, content: bytes | None, said: str) -> None:
    file = tmp_path / "x.pcapng"
    if content is not None:
        file.write_bytes(content)
    for arguments in (["replay", file], ["stand-in", "client", file], ["stand-in", "application", file]):
        ended = cli(*arguments)
        assert (ended.code, ended.out) == (2, "")
        assert ended.err.startswith(f"hil: capture {file}")
        assert said in ended.err
        assert ended.err.count("\n") == 1


def test_bad_options_are_one_sentence(run: Path) -> None:
    for speed in ("0", "fast", "-1", "nan"):
        ended = cli("replay", run, f"--speed={speed}")
        assert ended.code == 2
        assert "valid is max, or a number of 0.001 to 1000 times real time" in ended.err


def test_the_speed_can_be_that_of_the_recording(tmp_path: Path) -> None:
    short = DATA / "direct-servo-ideal.pcapng"
    ended, found = replayed(short, "--speed", 1, "--plot", tmp_path / "x.png")
    assert ended.code == 0
    assert 0.4 < found["took_s"] < 5.0
    assert found["real_time_factor"] <= 1.1
    assert (tmp_path / "x.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_wireshark_reads_a_run_without_a_warning(run: Path) -> None:
    assert any(isinstance(one, Notes) for one in records(run))
    command = [
        "tshark",
        "-r",
        str(run),
        "-T",
        "fields",
        "-e",
        "frame.number",
        "-e",
        "_ws.expert",
        "-e",
        "_ws.malformed",
    ]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert [line for line in result.stderr.splitlines() if not line.startswith("Running as user")] == []
    assert [line.split("\t") for line in result.stdout.splitlines()] == [
        [str(number), "", ""] for number in range(1, len(packets(run)) + 1)
    ]


@contextmanager
def running(place: Path, host: str, *options: object) -> Iterator["subprocess.Popen[str]"]:
    process = hil("run", "--fri-client", f"{host}:30200", "--backend", "ideal", "--pad", place, *options)
    try:
        wait_for_line(process, "pad: ")
        yield process
    finally:
        ended = finish(process, interrupt=True)
    assert ended.code == 0, ended.err


def capture(place: Path, *arguments: object) -> Ended:
    return cli("capture", *arguments, "--socket", place)


def test_a_capture_is_begun_and_ended_while_the_controller_runs(folder: Path) -> None:
    place, file = folder / "x", folder / "run.pcapng"
    with running(place, own_host()):
        assert capture(place, "status").out == "nothing was recorded\n"
        ended = capture(place, "stop")
        assert (ended.code, ended.err) == (2, "hil: no capture runs: hil capture start FILE.pcapng\n")
        assert capture(place, "start", file).out.startswith(f"recording to {file}; ")
        ended = capture(place, "start", folder / "other.pcapng")
        assert ended.code == 2
        assert f"a capture to {file} runs already" in ended.err
        assert not (folder / "other.pcapng").exists()
        assert capture(place, "start", file).code == 2  # and does not empty the file that is being written
        assert capture(place, "status").out == f"{file}: recording, 0 packets dropped\n"
        ended = capture(place, "stop")
        assert ended.code == 0, ended.err
        assert ended.out.startswith(f"{file}: complete, 0 packets dropped, ")
    found = packets(file)
    assert ended.out == f"{file}: complete, 0 packets dropped, {len(found)} written\n"
    assert len(found) > 50
    header = header_of(file)
    assert header.robots[0].cycles_before > 0
    assert not header.complete
    result = replay_file(file)
    assert result.notes[0].startswith(
        f"the recording began {header.robots[0].cycles_before} cycles after the controller"
    )


def test_a_capture_that_is_refused_leaves_the_file_as_it_was(folder: Path) -> None:
    place, file, older = folder / "x", folder / "run.pcapng", folder / "older.pcapng"
    older.write_bytes(b"what was recorded yesterday")
    with running(place, own_host()):
        assert capture(place, "start", older, "--ring", "many").code == 2
        assert older.read_bytes() == b"what was recorded yesterday"
        assert capture(place, "start", file).code == 0
        assert capture(place, "start", older).code == 2
        assert older.read_bytes() == b"what was recorded yesterday"
        assert capture(place, "start", file).code == 2  # nor is the one that is being written emptied
        ended = capture(place, "stop")
        assert ended.out == f"{file}: complete, 0 packets dropped, {len(packets(file))} written\n"
        assert capture(place, "start", older).code == 0  # one that is taken replaces what was there
        assert capture(place, "stop").code == 0
    assert packets(older)


def test_the_end_of_the_run_completes_a_capture(folder: Path) -> None:
    place, file = folder / "x", folder / "run.pcapng"
    with running(place, own_host(), "--status-json", folder / "status.json"):
        assert capture(place, "start", file).code == 0
    status = json.loads((folder / "status.json").read_text())
    assert status["capture"]["written"] == len(packets(file)) > 0
    assert status["capture"]["error"] is None


def test_a_ring_keeps_the_newest_files(folder: Path) -> None:
    file = folder / "run.pcapng"
    options = "--duration", 1.2, "--backend", "ideal", "--fri-client", f"{own_host()}:30200"
    ended = finish(hil("run", *options, "--capture", file, "--capture-ring", "3x100kB", "--progress", 0))
    assert ended.code == 0, ended.err
    kept = sorted(folder.glob("run*.pcapng"))
    assert len(kept) == 3
    assert file not in kept
    assert all(one.stat().st_size < 200_000 for one in kept)
    assert "in files the ring removed" in " ".join(ended.out.split())
    result = replay_file(kept[0])
    assert result.notes[0] == "the first files of the ring are not there: compared, not replayed to the byte"
    counters = [one.at_unix_ns for part in kept for one in packets(part)]
    assert counters == sorted(counters)
    whole = finish(hil("run", *options, "--capture", file, "--capture-ring", "99x100kB", "--progress", 0))
    assert whole.code == 0, whole.err
    assert replay_file(file).verdict.startswith("identical byte for byte")


@pytest.mark.parametrize("ring", ["1x1MB", "3x1kB", "many", "3x"])
def test_a_ring_that_cannot_be_is_one_sentence(ring: str) -> None:
    ended = finish(hil("run", "--capture", "x.pcapng", "--capture-ring", ring))
    assert ended.code == 2
    assert "capture ring" in ended.err
    assert "Traceback" not in ended.err


def test_a_recorded_client_moves_a_live_controller(tmp_path: Path) -> None:
    host = own_host()
    options = "--fri-client", f"{host}:30200", "--send-period", 5, "--status-json", tmp_path / "s.json"
    controller = hil("run", *options, "--duration", 3, "--progress", 0)
    client = cli("stand-in", "client", RECORDED, "--bind", f"{host}:30200", "--json", tmp_path / "c.json")
    ended = finish(controller)
    assert client.code == 0, client.err
    told = json.loads((tmp_path / "c.json").read_text())
    assert told["states"][:4] == ["MONITORING_WAIT", "MONITORING_READY", "COMMANDING_WAIT", "COMMANDING_ACTIVE"]
    assert told["malformed"] == 0
    robot = json.loads((tmp_path / "s.json").read_text())["robots"]["arm"]
    assert ended.code == 0
    assert robot["packets"]["dropped"]["undecodable"] == 0
    assert abs(robot["measured_position"][3] - robot["initial_position"][3]) > 1e-4


def test_a_recorded_controller_asks_a_live_client(tmp_path: Path) -> None:
    host = own_host()
    client = program("apps.fri_joint_sine", "--bind", host, "--seconds", 20, "--fri-version", "1.15")
    assert client.stdout is not None
    client.stdout.readline()
    told = tmp_path / "c.json"
    ended = cli("stand-in", "controller", RECORDED, "--client", f"{host}:30200", "--json", told)
    client.terminate()
    client.communicate()
    found = json.loads(told.read_text())
    # The recorded client was the same program: over a real network it says the same, unless a datagram was late.
    assert found["identical"] > 0.9 * found["compared"] > 200
    assert ended.code == (0 if found["equal"] else 1)


def test_a_recorded_application_moves_a_live_controller(tmp_path: Path) -> None:
    host = own_host()
    options = "--fri-client", "off", "--servo", f"{host}:30300", "--status-json", tmp_path / "s.json", "--progress", 0
    controller = hil("run", *options)
    wait_for_line(controller, "applications at")
    recorded = DATA / "smart-servo-2ms.pcapng"
    told = cli("stand-in", "application", recorded, "--controller", f"{host}:30300")
    ended = finish(controller, interrupt=True)
    assert told.code == 0, told.err
    assert ended.code == 0, ended.err
    robot = json.loads((tmp_path / "s.json").read_text())["robots"]["arm"]
    assert robot["servo"]["requests_taken"] > 150
    assert robot["servo"]["motions_begun"] == 1
    assert abs(robot["measured_position"][3] - robot["initial_position"][3]) > 1e-4


PROGRAM = """
import sys
from hil.client.servo import PTP, ServoClient
a4 = float(sys.argv[2])
with ServoClient(sys.argv[1]) as robot:
    robot.move(PTP((0.02, 0.5, 0.0, a4, 0.0, 1.5, 0.0)))
    robot.move(PTP((0.04, 0.5, 0.0, a4, 0.0, 1.5, 0.0)))
"""


@pytest.mark.parametrize(("a4", "code"), [(0.7, 0), (0.72, 1)])
def test_a_recorded_controller_asks_a_live_application(tmp_path: Path, a4: float, code: int) -> None:
    file, at = tmp_path / "run.pcapng", f"{own_host()}:30300"
    recorded = VirtualController(RobotConfig.model_validate({"backend": "ideal", "servo": {}}), capture=file)
    with recorded.active(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["", "anywhere", "0.7"])
        exec(PROGRAM, {})  # noqa: S102  # the very program that is run below
        recorded.run(0.2)
    application = subprocess.Popen([sys.executable, "-c", PROGRAM, at, str(a4)], cwd=ROOT)
    ended = cli("stand-in", "servo-controller", file, "--bind", at)
    assert application.wait(timeout=20) == 0
    assert ended.code == code, ended
    if code:
        assert "A4 destination +20 mrad (recorded 0.7, application 0.72)" in ended.out
    else:
        assert "requests are those recorded" in ended.out


def test_nobody_there_is_one_sentence(tmp_path: Path) -> None:
    host = own_host()
    ended = cli("stand-in", "controller", RECORDED, "--client", f"{host}:30200")
    assert ended.code == 2
    assert f"no answer came from {host}:30200" in ended.err
