"""``hil_process``: a real controller process, on addresses of its own, and what it said when the test fails."""

from pathlib import Path

import pytest

import hil.testkit.controller
import hil.testkit.process  # pytester forgets what it imported, and numpy cannot be imported twice
from hil.client.fri import FriClient, FriHandler, Release
from hil.client.pad import PadRefused
from hil.client.servo import PTP, ServoClient
from hil.testkit import ProcessFailed
from hil.testkit._configuration import configuration
from hil.testkit.process import controller_process, toml
from hil.values.errors import ConfigurationError, UsageError
from tests.support.virtual_controller import PLUGIN

pytest_plugins = ["pytester"]


def test_a_process_serves_both_links_and_obeys_the_operator() -> None:
    keys = {"mode": "T1", "fri": {"release": "2.5", "send_period_ms": 5}, "backend": "mujoco"}
    with controller_process(configuration([((), keys)], folders=[]).station) as process:
        with pytest.raises(UsageError, match="call stop"):
            process.status()
        assert process.pad()["program"] == "PAUSED"
        process.operator.enable()
        process.operator.start()
        process.operator.override(50)
        assert process.pad()["override_percent"] == 50.0
        with FriClient(
            FriHandler(), release=Release.V2_5, bind_host=process.fri_client_host, port=process.fri_client_port
        ) as client:
            client.run(duration_s=0.2)
        assert client.session.answered > 10
        with ServoClient(process.servo_address) as robot:
            goal = list(robot.read_state().measured_position)
            goal[3] += 0.02
            robot.move(PTP(goal))
        process.operator.push((5.0, 0.0, 0.0), duration_s=0.1)
        process.operator.emergency_stop()
        with pytest.raises(PadRefused, match="reset"):
            process.operator.start()
        status = process.stop()
        assert process.stop() == status == process.status()
    assert status["servo"]["motions_begun"] == 1
    assert status["stops"]
    assert "emergency stop" in process.output


def test_a_process_records_a_capture(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    with controller_process(configuration([((), {"servo": None, "capture": file})], folders=[]).station) as process:
        process.stop()
    assert file.stat().st_size > 1000


def test_a_process_that_cannot_start_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    # A loopback address is free for a test; one of another machine is not.
    monkeypatch.setattr("hil.testkit.process.free_host", lambda: "192.0.2.1")
    monkeypatch.setattr("hil.testkit.process.free_port", lambda _host: 30200)
    station = configuration([((), {})], folders=[]).station
    with pytest.raises(ProcessFailed, match=r"exit code 2; it said:\n.*192\.0\.2\.1"), controller_process(station):
        pass


def test_virtual_time_has_no_kst_server_and_says_so() -> None:
    with pytest.raises(ConfigurationError, match="virtual time has no KST server, which is a process: use hil_process"):
        hil.testkit.controller.VirtualController(configuration([((), {"kst": {}})], folders=[]).robot)


def test_links_that_were_left_out_are_no_addresses() -> None:
    with controller_process(configuration([((), {"fri": None, "servo": None})], folders=[]).station) as process:
        with pytest.raises(UsageError, match="fri=None"):
            assert process.fri_client_address
        with pytest.raises(UsageError, match="servo=None"):
            assert process.servo_address
        with pytest.raises(UsageError, match="kst=None"):
            assert process.kst_address


def test_a_station_is_the_same_as_toml(tmp_path: Path) -> None:
    robot = {
        "name": 'a "quoted" name',
        "fri": {"release": "2.5", "transformations": ["camera", "belt"]},
        "tool": [{"name": "gripper", "mounted": True, "mass_kg": 1.5, "centre_mm": [0, 0, 30]}],
        "torque_noise": False,
    }
    station = configuration([((), robot)], folders=[]).station
    file = tmp_path / "station.toml"
    content = station.model_dump(mode="json", exclude_unset=True)
    file.write_text("".join(f"{key} = {toml(value)}\n" for key, value in content.items()), encoding="utf-8")
    assert configuration([(("station.toml",), {})], folders=[tmp_path]).robot == station.robot[0]


def test_the_output_of_the_process_is_shown_when_the_test_fails(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        import pytest

        @pytest.mark.hil(fri=None)
        def test_it(hil_process):
            hil_process.operator.emergency_stop()
            assert False
    """)
    result = pytester.runpytest_inprocess(*PLUGIN, "-p", "no:asyncio", "-W", "error")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*hil run teardown*", "*applications at 127.*", "*the emergency stop was pressed*"])


def test_a_bad_network_stands_between_the_links_and_is_counted() -> None:
    keys = {"fri": {"release": "2.5", "send_period_ms": 5}}
    with controller_process(configuration([((), keys)], folders=[]).station) as process:
        before = process.servo_address, process.fri_client_address
        process.impair("servo", "loss=20%", seed=1)
        process.impair("fri", "packet=drop@3:to-peer")
        assert process.servo_address != before[0]
        assert process.fri_client_address != before[1]
        with FriClient(
            FriHandler(), release=Release.V2_5, bind_host=process.fri_client_host, port=process.fri_client_port
        ) as client:
            client.run(duration_s=0.2)
        with ServoClient(process.servo_address) as robot:
            goal = list(robot.read_state().measured_position)
            goal[3] += 0.02
            robot.move(PTP(goal))
        with pytest.raises(UsageError, match="call stop"):
            process.impairments()
        status = process.stop()
    servo, fri = process.impairments()
    assert servo["faults"][0]["fired"] > 3
    assert [fault["fired"] for fault in fri["faults"]] == [1]
    assert status["packets"]["accepted"] > 10


def test_a_fault_between_processes_that_never_fires_fails_the_end() -> None:
    with controller_process(configuration([((), {"fri": None})], folders=[]).station) as process:
        process.impair("servo", "loss=50%")
        with pytest.raises(ProcessFailed, match="never fired: loss=50%"):
            process.stop()
        with pytest.raises(UsageError, match="fri, servo"):
            process.impair("pad", "loss=50%")
