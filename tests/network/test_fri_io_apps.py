"""The I/O client and the transformation provider as processes of their own, against ``hil run``."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hil.client.pad import PadClient
from hil.values.fri import Release
from tests.support.processes import ROOT, Ended, finish, hil, own_host, wait_for_line

PNG = b"\x89PNG"
STATION = """
[[robot]]
backend = "ideal"
[[robot.io]]
name = "FRI"
signal = [
    { name = "Out_Analog_Deci_Seconds", type = "analog", direction = "output", initial = 0.3 },
    { name = "Out_Integer_Seconds", type = "digital", direction = "output", initial = 7 },
    { name = "In_Bool_Clock_Enabled", type = "boolean", direction = "input", initial = %s },
]
[robot.fri]
client = "%s:30200"
release = "%s"
send_period_ms = 5
overlay = "%s"
transformations = ["PBase", "Part"]
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="io") as name:
        yield Path(name)


def station(folder: Path, host: str, release: Release, *, enabled: str = "true", overlay: str = "none") -> Path:
    file = folder / "station.toml"
    file.write_text(STATION % (enabled, host, release.value, overlay), encoding="utf-8")
    return file


def application(name: str, host: str, release: Release, *arguments: object) -> "subprocess.Popen[str]":
    command = [sys.executable, "-W", "error", "-m", f"apps.{name}", "--bind", host, "--fri-version", release.value]
    return subprocess.Popen(
        [*command, *map(str, arguments)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def served(
    folder: Path, name: str, release: Release, *arguments: object, seconds: float = 2.0, overlay: str = "none"
) -> tuple[Ended, dict[str, Any]]:
    """Run controller and application together; return the application's end and the robot's part of the status file."""
    host, status = own_host(), folder / "status.json"
    client = application(name, host, release, *arguments)
    file = station(folder, host, release, overlay=overlay)
    controller = finish(hil("run", file, "--duration", seconds, "--status-json", status, "--progress", 0))
    ended = finish(client)
    assert controller.code == 0, controller.err
    assert "Traceback" not in controller.err
    robots = json.loads(status.read_text(encoding="utf-8"))["robots"]
    return ended, robots["arm"] if isinstance(robots, dict) else robots[0]


@pytest.mark.parametrize("release", [Release.V1_14, Release.V2_7])
def test_the_io_client_counts_while_its_input_is_on(folder: Path, release: Release) -> None:
    picture, figures = folder / "io.png", folder / "io.json"
    ended, robot = served(folder, "fri_io", release, "--plot", picture, "--json", figures)
    assert ended.code == 0, ended.err
    result = json.loads(figures.read_text(encoding="utf-8"))
    assert result["ticks"] >= 10
    # From 7.3 seconds on, a tenth for each tick; the last one may not have arrived any more.
    values = {name: signal["value"] for name, signal in robot["io"].items()}
    counted = values["FRI.Out_Integer_Seconds"] * 10 + values["FRI.Out_Analog_Deci_Seconds"] * 10 - 73
    assert round(counted, 6) in {result["ticks"], result["ticks"] - 1}
    assert values["FRI.Out_Integer_Seconds"] >= 8
    assert picture.read_bytes().startswith(PNG)
    assert f"{result['ticks']} ticks; FRI.In_Bool_Clock_Enabled 1, FRI.Out_Analog_Deci_Seconds " in ended.out
    assert robot["packets"]["dropped"]["not_allowed"] == 0


@pytest.mark.parametrize("release", [Release.V1_11, Release.V1_16, Release.V2_5])
def test_the_provider_provides_what_it_is_asked_for_while_the_arm_is_commanded(folder: Path, release: Release) -> None:
    picture, figures = folder / "trafo.png", folder / "trafo.json"
    ended, robot = served(
        folder,
        "fri_transformation_provider",
        release,
        "--plot",
        picture,
        "--json",
        figures,
        seconds=3.0,
        overlay="joint-position",
    )
    assert ended.code == 0, ended.err
    result = json.loads(figures.read_text(encoding="utf-8"))
    assert result["requested"] == ["PBase", "Part"]
    assert result["states"]["COMMANDING_ACTIVE"] > 10
    assert picture.read_bytes().startswith(PNG)
    # The last answers may meet a controller that has ended; those that were late are not taken.
    assert result["answers"] - 5 <= robot["packets"]["received"] <= result["answers"]
    for given in robot["transformations"].values():
        assert given["quaternion_wxyz"] == [1.0, 0.0, 0.0, 0.0]
        assert given["updates"] == robot["packets"]["accepted"]
        assert given["received_s"] > 2.5
    assert not any(robot["packets"]["dropped"][name] for name in ("not_allowed", "shape", "not_finite"))


def test_an_input_set_with_the_pad_starts_the_clock(folder: Path) -> None:
    host, figures, place = own_host(), folder / "io.json", folder / "pad"
    client = application("fri_io", host, Release.V1_15, "--json", figures)
    controller = hil("run", station(folder, host, Release.V1_15, enabled="false"), "--pad", place, "--progress", 0)
    wait_for_line(controller, "-> MONITORING_READY")
    with PadClient(place) as pad:
        before = pad.status()["arm"]["io"]
        assert (before["FRI.Out_Analog_Deci_Seconds"]["value"], before["FRI.In_Bool_Clock_Enabled"]["value"]) == (
            0.3,
            False,
        )
        pad.set_input("FRI.In_Bool_Clock_Enabled", True)
        for robots in pad.states():
            if robots["arm"]["io"]["FRI.Out_Integer_Seconds"]["value"] == 8:
                break
    assert finish(controller, interrupt=True).code == 0
    assert finish(client).code == 0
    assert json.loads(figures.read_text(encoding="utf-8"))["ticks"] >= 7


def test_a_release_or_a_station_without_them_is_said_in_words(folder: Path) -> None:
    ended, _ = served(folder, "fri_io", Release.V1_11)
    assert ended.code == 2
    assert "fri_io: there is no input or output in FRI 1.11" in ended.err
    host = own_host()
    for name, code, said in (
        ("fri_io", 2, "unknown input or output 'FRI.In_Bool_Clock_Enabled'; valid: "),
        ("fri_transformation_provider", 1, "the controller asks for no transformation"),
    ):
        client = application(name, host, Release.V1_15)
        run = finish(hil("run", "--fri-client", f"{host}:30200", "--backend", "ideal", "--duration", 1))
        assert run.code == 0, run.err
        ended = finish(client)
        assert ended.code == code, ended
        assert said in ended.out + ended.err


@pytest.mark.parametrize("name", ["fri_io", "fri_transformation_provider"])
def test_nobody_there_and_a_picture_that_cannot_be_written(name: str, tmp_path: Path) -> None:
    alone = finish(application(name, own_host(), Release.V1_15, "--port", 0, "--seconds", 0.01))
    assert alone.code == 1
    assert "no datagram came: does the controller run" in alone.err
    assert alone.out.endswith("no controller was heard\n")
    picture = tmp_path / "nowhere" / "x.png"
    nowhere = finish(application(name, own_host(), Release.V1_15, "--port", 0, "--seconds", 0, "--plot", picture))
    assert nowhere.code == 2
    assert nowhere.err.endswith(f"{name}: cannot write {picture}: No such file or directory\n")
