"""``hil rendering`` against a running controller and a stand-in for CoppeliaSim."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.cli import cli
from tests.support.coppelia import JOINT, Scene, StandIn, add_arm
from tests.support.processes import finish, hil, own_host, wait_for_line
from tools.view.choices import choices_path

START_RAD = [0.0, 0.5236, 0.0, 0.6981, 0.0, 1.5708, 0.0]


def one_arm() -> Scene:
    scene = Scene()
    add_arm(scene, alias="iiwa")
    return scene


@pytest.fixture
def folder() -> Iterator[Path]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="rend") as name:
        yield Path(name)


@pytest.fixture
def station(folder: Path) -> Path:
    path = folder / "cell.toml"
    path.write_text(
        f'[[robot]]\nname = "left"\nbackend = "ideal"\n[robot.servo]\nbind = "{own_host()}:0"\n', encoding="utf-8"
    )
    return path


def test_a_running_robot_stands_in_the_scene_and_is_red_when_it_is_gone(folder: Path, station: Path) -> None:
    scene, pad = folder / "cell.ttt", folder / "pad"
    scene.write_bytes(b"")
    controller = hil("run", station, "--pad", pad, "--progress", 0, station_links=True)
    with StandIn(own_host(), scenes={str(scene.resolve()): one_arm}) as simulator:
        wait_for_line(controller, "pad: ")
        process = hil(
            "rendering", station, "--socket", pad, "--scene", scene, "--coppeliasim", simulator.address, typed=True
        )
        assert process.stdin is not None
        assert process.stdout is not None
        assert wait_for_line(process, "the live view is on; 3 frames are drawn")
        assert process.stdout.readline() == "left: /iiwa, connected\n"
        positions = [one.position for one in simulator.scene.things.values() if one.kind == JOINT]
        assert sorted(positions) == pytest.approx(sorted(START_RAD), abs=1e-3)

        text = station.read_text(encoding="utf-8")
        for added, said in (
            ('[[robot.frame]]\nname = "table"\n', "station and scene were read again; 4 frames are drawn"),
            ("[[robot.frame]]\n", "frame[1].name: Field required"),
        ):
            station.write_text(text + added, encoding="utf-8")
            process.stdin.write("\n")
            process.stdin.flush()
            wait_for_line(process, said)
        assert simulator.scene.named("table")

        ended = finish(controller, interrupt=True)
        assert ended.code == 0, ended.err
        lost = "left: /iiwa, lost: the session with the controller is over: the controller shuts down\n"
        assert process.stdout.readline() == lost
        # What a line says of it, the scene had before.
        assert [1.0, 0.0, 0.0, 1.0, 0.0, 0.0] in [one.colours for one in simulator.scene.things.values()]
        ended = finish(process, interrupt=True)
        assert (ended.code, ended.err) == (0, "")
        assert [1.0, 0.0, 0.0, 1.0, 0.0, 0.0] not in [one.colours for one in simulator.scene.things.values()]
    assert 'scene = "cell.ttt"' in choices_path(station).read_text(encoding="utf-8")


def test_what_is_kept_is_shown(station: Path) -> None:
    assert cli("rendering", station, "--choices").out == (
        "browser: no scene was chosen yet\ncoppeliasim: no scene was chosen yet\n"
    )
    choices_path(station).write_text(
        '[coppeliasim]\nscene = "cell.ttt"\n[coppeliasim.devices]\nleft = "/iiwa"\n', encoding="utf-8"
    )
    assert cli("rendering", station, "--choices").out == (
        "browser: no scene was chosen yet\ncoppeliasim: cell.ttt\n  left (lbr-iiwa-14-r820): /iiwa\n"
    )


@pytest.mark.parametrize(
    ("options", "kept", "said"),
    [
        ((), "", "no scene is kept with {station} yet; choose one with --scene FILE.ttt"),
        (("--devices", "left"), "", "--devices 'left' is not ROBOT=DEVICE, such as left=/LBRiiwa7R800"),
        (("--coppeliasim", "nowhere:0"), "", "'nowhere:0' is no address of a simulator; valid: HOST[:PORT], port 1.."),
        ((), "scene = 3", "{kept} is not what was kept: scene: Extra inputs are not permitted; repair"),
        (("--scene", "nowhere.ttt"), "", "there is no scene file "),
        (("--socket", "/nowhere"), '[coppeliasim]\nscene = "cell.ttt"', "/nowhere"),
    ],
)
def test_what_cannot_work_ends_with_a_sentence(station: Path, options: tuple[str, ...], kept: str, said: str) -> None:
    if kept:
        choices_path(station).write_text(kept, encoding="utf-8")
    ended = cli("rendering", station, *options)
    assert ended.code == 2
    assert said.format(station=station, kept=choices_path(station)) in ended.err
    assert ended.err.startswith("hil: ")
    assert ended.err.count("\n") == 1
    assert choices_path(station).exists() is bool(kept)
