"""The station of the example: two arms at one table, live, one of them touching, and replayed to the byte."""

import json
from pathlib import Path

from hil.client.servo import PTP, ServoClient
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line

STATION = ROOT / "examples" / "scene" / "station.toml"
PANE = """
[[object]]
name = "pane"                     # a third of a millimetre into the wrist of the left arm
size_mm = [20, 400, 400]
x_mm = 275
z_mm = 1100
"""


def test_two_arms_of_one_world_run_and_replay(tmp_path: Path) -> None:
    host, station, status, capture = own_host(), tmp_path / "s.toml", tmp_path / "s.json", tmp_path / "s.pcapng"
    station.write_text(STATION.read_text().replace("127.0.0.1", host) + PANE)
    process = hil("run", station, "--status-json", status, "--capture", capture, station_links=True)
    wait_for_line(process, f"right: lbr-iiwa-7-r800, backend mujoco, mode AUT, cycle 1 ms; applications at {host}")
    with ServoClient(f"{host}:30300") as robot:
        touching = robot.read_state()
        assert touching.contacts
        assert touching.contacts[0].force_n[0] < -1.0
        assert abs(touching.contacts[0].point_m[0] - 0.265) < 1e-3
        start = touching.measured_position
        robot.move(PTP((start[0] + 0.1, *start[1:])))
        away = robot.read_state()
        assert away.contacts == ()
        assert 0.0 < away.flange_speed_mm_s < 10.0
    assert finish(process, interrupt=True).code == 0
    robots = json.loads(status.read_text())["robots"]
    assert set(robots) == {"left", "right"}
    assert abs(robots["left"]["measured_position"][0] - start[0] - 0.1) < 1e-3
    replayed = finish(hil("replay", capture))
    assert replayed.code == 0, replayed.out
    assert "identical byte for byte" in replayed.out
