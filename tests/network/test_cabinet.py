"""The split form as real processes: a robot side behind FRI, a controller on the backend ``cabinet``, applications."""

import json
import re
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from hil.client.pad import PadClient, PadRefused
from hil.client.servo import PTP, CommandInvalidException, ServoClient
from hil.values.fri import Release
from hil.values.fri_messages import MonitoringMessage
from tests.support.processes import finish, hil, own_host, wait_for_line
from transport.fri import FriCodec

PERIOD_MS = 5
RAISED_RAD = 0.15


def robot_side(host: str, *arguments: object, period_ms: int = PERIOD_MS) -> "subprocess.Popen[str]":
    return hil(
        "run", "--backend", "ideal", "--cycle", period_ms, "--send-period", period_ms,
        "--fri-client", f"{host}:30200", "--progress", 0, *arguments,
    )  # fmt: skip


def controller(host: str, *arguments: object, connect_s: float = 10.0) -> "subprocess.Popen[str]":
    return hil(
        "run", "--backend", "cabinet", "-o", f"bind={host}:30200", "--cycle", PERIOD_MS, "--progress", 0,
        "-o", f"connect_s={connect_s}", "-o", "silence_ms=200", "--fri-client", "off", *arguments,
    )  # fmt: skip


@pytest.mark.alone
def test_a_lost_cabinet_stops_the_motion_and_one_that_comes_back_moves_when_told_to(tmp_path: Path) -> None:
    host, servo, pad = own_host(), own_host(), tmp_path / "pad"
    outer_status, inner_status, capture = (tmp_path / name for name in ("outer.json", "inner.json", "run.pcapng"))
    inner = robot_side(host)
    outer = controller(host, "--servo", f"{servo}:0", "--pad", pad, "--status-json", outer_status, "--capture", capture)
    served = re.search(r"applications at (\S+),", wait_for_line(outer, "applications at ")[-1])
    assert served is not None
    with PadClient(pad) as operator, ServoClient(served[1], name="carrying") as robot:
        start = robot.read_state().measured_position
        raised = (*start[:3], start[3] + RAISED_RAD, *start[4:])
        # It waits for the Cabinet's session to come to COMMANDING, and then goes on by itself.
        robot.move(PTP(raised))
        assert robot.read_state().measured_position == pytest.approx(raised, abs=1e-4)
        motion = PTP((start[0] + 1.5, *raised[1:])).set_joint_velocity_rel(0.2)
        robot.move_async(motion)
        while robot.read_state().measured_position[0] < start[0] + 0.05:
            pass
        inner.send_signal(signal.SIGKILL)
        inner.communicate()
        with pytest.raises(
            CommandInvalidException, match=r"the Cabinet at \S+ is lost: no message for [\d.]+ ms, 200 ms are"
        ):
            motion.wait_until_ended()
        with pytest.raises(PadRefused, match=r"the robot side has not recovered: the Cabinet at"):
            operator.reset()
        inner = robot_side(host, "--status-json", inner_status)
        wait_for_line(inner, "MONITORING_READY -> COMMANDING_WAIT")
        before = robot.read_state().measured_position
        operator.reset()
        operator.start()
        robot.move(PTP(start))
        # The new robot side stands where robot sides begin: nothing was moved before it was told to.
        assert before == pytest.approx(start, abs=1e-9)
    ended = finish(outer, interrupt=True)
    assert ended.code == 0, ended.err
    assert finish(inner, interrupt=True).code == 0
    arm = json.loads(outer_status.read_text())["robots"]["arm"]
    assert [entry["to"] for entry in arm["robot_side"]["transitions"]].count("COMMANDING_ACTIVE") == 2
    assert arm["robot_side"]["restarts"] == 1
    assert arm["stops"][0]["category"] == 0
    replayed = finish(hil("replay", capture))
    assert replayed.code == 0, replayed.out + replayed.err
    assert "identical byte for byte" in replayed.out


def test_without_a_cabinet_it_says_so_and_ends(tmp_path: Path) -> None:
    ended = finish(controller(own_host(), connect_s=0.2))
    assert ended.code == 2
    assert "no message of a Cabinet came to UDP" in ended.err
    assert "within 0.2 s" in ended.err


def test_a_cabinet_of_another_release_or_period_is_named(tmp_path: Path) -> None:
    host = own_host()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as cabinet:
        cabinet.bind((host, 0))
        for datagram, sentence in (
            (message(Release.V2_7), "is no message of release 1.15: a message with length and CRC"),
            (message(Release.V1_15, send_period_ms=10), "sends every 10 ms, this station's cycle is 5 ms"),
        ):
            process = controller(host)
            wait_for_line(process, "waiting for the robot side's first message")
            for _ in range(10):
                cabinet.sendto(datagram, (host, 30200))
            ended = finish(process)
            assert ended.code == 2
            assert sentence in ended.err


def test_an_interrupt_ends_the_waiting() -> None:
    process = controller(own_host(), connect_s=60.0)
    wait_for_line(process, "waiting for the robot side's first message")
    ended = finish(process, interrupt=True)
    assert ended.code == 2
    assert "no message of a Cabinet came" in ended.err


def message(release: Release, *, send_period_ms: int = PERIOD_MS) -> bytes:
    from hil.values.fri_messages import ConnectionInfo, MonitorData, RobotInfo

    joints = (0.0,) * 7
    commanded = None if release is Release.V2_7 else joints
    return FriCodec(release).encode_monitoring(
        MonitoringMessage(
            sequence_counter=1,
            reflected_sequence_counter=0,
            robot=RobotInfo(7, 0, (2,) * 7, 2, 0),
            monitor=MonitorData(joints, joints, commanded, joints, joints, None, (), None, None, None),
            connection=ConnectionInfo(1, 0, send_period_ms, 1),
            ipo=None,
        )
    )


@pytest.mark.alone
def test_run_with_shadow_only_watches(tmp_path: Path) -> None:
    host, status = own_host(), tmp_path / "watched.json"
    watched = robot_side(host, "--status-json", status)
    ended = finish(
        hil("run", "--backend", "cabinet", "--shadow", "-o", f"bind={host}:30200", "--duration", 2.5), timeout_s=60
    )
    assert ended.code == 0, ended.err
    assert "emulated minus real" in ended.out
    assert finish(watched, interrupt=True).code == 0
    states = [entry["to"] for entry in json.loads(status.read_text())["robots"]["arm"]["session"]["history"]]
    assert "COMMANDING_WAIT" in states
    assert "COMMANDING_ACTIVE" not in states


def test_shadow_is_of_a_cabinet_alone() -> None:
    ended = finish(hil("run", "--shadow"))
    assert ended.code == 2
    assert "it needs --backend cabinet, not mujoco" in ended.err
