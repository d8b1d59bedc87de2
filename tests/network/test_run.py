"""``hil run`` as a process: signals, strangers, ports, several robots, exit codes."""

import json
import os
import signal
import socket
from pathlib import Path

import pytest

from tests.support.cli import cli
from tests.support.processes import finish, hil, own_host, probe, run_with_probe, wait_for_line


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_brakes_closes_the_session_and_reports(tmp_path: Path, number: signal.Signals) -> None:
    host, status, capture = own_host(), tmp_path / "status.json", tmp_path / "run.pcapng"
    client = probe("--release", "1.16", "--bind", host, "--seconds", 20)
    controller = hil(
        "run", "--fri-client", host, "--fri-version", "1.16", "--send-period", 2,
        "--status-json", status, "--capture", capture,
    )  # fmt: skip
    wait_for_line(controller, "COMMANDING_WAIT -> COMMANDING_ACTIVE")
    controller.send_signal(number)
    ended = finish(controller)
    found = json.loads(finish(client).out)
    assert ended.code == 0, ended.err
    assert found["history"][-1][1] == "IDLE"
    report = json.loads(status.read_text())
    assert report["robots"]["arm"]["session"]["state"] == "IDLE"
    assert report["robots"]["arm"]["stops"][-1]["reason"] == "the controller shuts down"
    assert report["capture"]["error"] is None
    assert report["capture"]["written"] > 0


def test_a_second_ctrl_c_loses_nothing(tmp_path: Path) -> None:
    status, capture = tmp_path / "status.json", tmp_path / "run.pcapng"
    controller = hil("run", "--fri-client", own_host(), "--status-json", status, "--capture", capture)
    wait_for_line(controller, "IDLE -> MONITORING_WAIT")
    for _ in range(3):
        controller.send_signal(signal.SIGINT)
    ended = finish(controller)
    assert ended.code in {0, 130, -signal.SIGINT}, ended.err
    assert json.loads(status.read_text())["capture"]["error"] is None


def test_a_stranger_is_counted_and_answered_nothing(tmp_path: Path) -> None:
    host, bound, status = own_host(), own_host(), tmp_path / "status.json"
    controller = hil(
        "run", "--fri-client", f"{host}:30200", "--fri-bind", f"{bound}:30205", "--duration", 1.5, "--backend", "ideal",
        "--status-json", status,
    )  # fmt: skip
    wait_for_line(controller, "IDLE -> MONITORING_WAIT")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((host, 0))
        for _ in range(25):
            stranger.sendto(b"\x0a\x0a\x08\x81\x80\x0d\x10\x00\x18\x00", (bound, 30205))
        assert finish(controller).code == 0
        stranger.setblocking(False)
        with pytest.raises(BlockingIOError):
            stranger.recv(2000)
    packets = json.loads(status.read_text())["robots"]["arm"]["packets"]
    assert packets["dropped"]["stranger"] == 25
    assert packets["received"] == 25
    assert packets["accepted"] == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--send-period", 0], "send period 0 ms is outside 1..100 ms"),
        (["--send-period", 50, "--receive-multiplier", 3], "= 150 ms is more than 100 ms"),
        (["--robot", "lbr-iiwa-15"], "unknown robot 'lbr-iiwa-15'; valid: lbr-iiwa-7-r800"),
        (["--backend", "gazebo"], "unknown backend 'gazebo'; valid: cabinet, can402, ideal, mujoco"),
        (["--fri-bind", "0.0.0.0:30200"], "it would take the client's port 30200 on every address"),
        (["--fri-bind", "127.0.0.1:30200"], "that is the client's own address"),
        (["--fri-client", "127.0.0.1:none"], "the port 'none' is no number"),
        (["--fri-client", "127.0.0.1:70000"], "port 70000 is outside 0..65535"),
        (["--fri-client", "no.such.host.invalid"], "there is no host 'no.such.host.invalid'"),
        (["--capture", "/nowhere/at/all.pcapng"], "/nowhere/at/all.pcapng"),
        (["--status-json", "/nowhere/at/all.json"], "there is no folder /nowhere/at"),
        (["--status-json", "/tmp"], "that is a folder"),  # noqa: S108
        (["--status-json", "/tmp/x.pcapng", "--capture", "/tmp/x.pcapng"], "cannot be both"),  # noqa: S108
        (["--fri-client", "127.0.0.1:0"], "needs a port of its own"),
        (["nothing.toml"], "cannot read station file nothing.toml"),
    ],
)
def test_what_cannot_work_ends_in_one_sentence_and_exit_code_2(arguments: list[object], sentence: str) -> None:
    ended = cli("run", *arguments, "--servo", "off", "--pad", "off", "--duration", 1)
    assert ended.code == 2
    assert sentence in ended.err
    assert "Traceback" not in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_a_port_in_use_is_named_with_the_ways_out() -> None:
    host = own_host()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((host, 0))
        taken = f"{host}:{other.getsockname()[1]}"
        ended = finish(hil("run", "--fri-bind", taken, "--fri-client", own_host(), "--duration", 1))
    assert ended.code == 2
    assert f"cannot bind UDP {taken}: Address already in use" in ended.err
    assert "namespace" in ended.err


def test_a_wrong_option_is_exit_code_2() -> None:
    ended = finish(hil("run", "--mode", "T9"))
    assert ended.code == 2
    assert "T9" in ended.err


def test_two_robots_in_one_process_each_with_its_client(tmp_path: Path) -> None:
    hosts = own_host(), own_host()
    station = tmp_path / "two.toml"
    station.write_text(
        "\n".join(
            f'[[robot]]\nname = "{name}"\nmodel = "{model}"\n[robot.fri]\nclient = "{host}"\n'
            f'release = "{release}"\nsend_period_ms = 4'
            for name, model, host, release in (
                ("left", "lbr-med-7", hosts[0], "1.14"),
                ("right", "lbr-iiwa-7-r800", hosts[1], "2.5"),
            )
        )
    )
    clients = [
        probe("--release", release, "--bind", host, "--seconds", 12)
        for host, release in zip(hosts, ("1.14", "2.5"), strict=True)
    ]
    status = tmp_path / "status.json"
    ended = finish(hil("run", station, "--duration", 4, "--status-json", status))
    assert ended.code == 0, ended.err
    for client in clients:
        found = json.loads(finish(client).out)
        assert found["errors"] == {}
        assert "COMMANDING_ACTIVE" in found["states"]
    assert set(json.loads(status.read_text())["robots"]) == {"left", "right"}


def test_config_init_check_schema(tmp_path: Path) -> None:
    file = tmp_path / "station.toml"
    assert finish(hil("config", "init", file)).code == 0
    again = finish(hil("config", "init", file))
    assert (again.code, "is there already" in again.err) == (2, True)
    checked = finish(hil("config", "check", file))
    assert checked.code == 0
    assert "lbr-iiwa-14-r820" in checked.out
    assert "properties" in json.loads(finish(hil("config", "schema")).out)
    file.write_text(file.read_text().replace('"mujoco" ', '"gazebo" '))
    bad = finish(hil("config", "check", file))
    assert (bad.code, "unknown backend 'gazebo'" in bad.err) == (2, True)


def test_realtime_says_what_it_got(tmp_path: Path) -> None:
    _, status, lines = run_with_probe(tmp_path, "1.15", seconds=0.5, run=["--realtime"])
    assert {wish["what"].split()[0] for wish in status["realtime"]} == {"SCHED_FIFO", "locked", "a"}
    assert lines.count("realtime: ") == 3


def test_nobody_reading_the_output_does_not_stop_it(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    controller = hil(
        "run", "--fri-client", own_host(), "--backend", "ideal", "--duration", 1.5, "--progress", 0.001,
        "--status-json", status,
    )  # fmt: skip
    assert controller.stderr is not None
    os.close(os.dup(controller.stderr.fileno()))
    ended = finish(controller)
    assert ended.code == 0
    assert json.loads(status.read_text())["robots"]["arm"]["ticks"] > 1000
