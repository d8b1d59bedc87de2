"""``hil view`` beside two robots: both in one scene, inputs, a push with the mouse, and a robot that is lost."""

import math
import re
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from backends.robots.visual import visual_parts
from hil.client.pad import PadClient
from hil.client.servo import Role, ServoClient
from tests.support.chromium import CHROMIUM, NO_CHROMIUM, Browser
from tests.support.page import Page
from tests.support.processes import finish, hil, own_host, wait_for_line
from tools.view.browser.camera import FIELD_OF_VIEW_RAD, Camera, camera_for
from tools.view.station_robots import station_robots
from transport.udp import free_port

pytestmark = [pytest.mark.alone, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]

_TRIES = 5
CELL = """
[[object]]
name = "table"
shape = "box"
size_mm = [400, 400, 300]
x_mm = 700
z_mm = 150

[[robot]]
name = "left"
model = "lbr-iiwa-14-r820"
cycle_ms = 2
[robot.base]
y_mm = 400
[robot.servo]
bind = "{host}:30300"
[[robot.frame]]
name = "corner"
x_mm = 500
[[robot.io]]
name = "Lamp"
[[robot.io.signal]]
name = "Request"
direction = "input"
type = "boolean"

[[robot]]
name = "right"
model = "lbr-iiwa-7-r800"
cycle_ms = 2
[robot.base]
y_mm = -400
a_deg = 90
[robot.servo]
bind = "{host}:30301"
"""


class Cell:
    """A controller of two robots, and a view of its own beside it."""

    def __init__(self, folder: Path) -> None:
        self.host = own_host()
        self.file = folder / "cell.toml"
        self.file.write_text(CELL.format(host=self.host))
        self.pad = folder / "pad.sock"
        self.controller = self.start()
        self.view = hil("view", "--socket", self.pad, "--host", self.host, "--port", free_port(self.host))
        told = wait_for_line(self.view, "?websocket=")[-1]
        self.operator_address = told.split()[1]

    def start(self) -> "subprocess.Popen[str]":
        controller = hil("run", self.file, "--pad", self.pad, "--progress", 0, station_links=True)
        wait_for_line(controller, "pad: ")
        return controller


@pytest.fixture(scope="module")
def cell() -> Iterator[Cell]:
    with tempfile.TemporaryDirectory(prefix="pad") as folder:
        station = Cell(Path(folder))
        yield station
        for process in (station.view, station.controller):
            ended = finish(process, interrupt=True)
            assert ended.code == 0, ended.err


@pytest.fixture(scope="module")
def page(cell: Cell, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with Browser(tmp_path_factory.mktemp("chromium"), reaches=[cell.host]) as browser:
        opened = Page(browser, cell.operator_address)
        opened.wait_until_complete()
        yield opened


def test_two_robots_stand_in_one_scene(page: Page) -> None:
    # Of each robot as many parts have that many vertices, and the first one is part of its base.
    drawn = page.drawn(len(visual_parts("lbr-iiwa-14-r820")[0].vertices))
    left, right = (np.array(drawn[first]).reshape(4, 4).T for first in (0, len(drawn) // 2))
    assert np.linalg.norm(left[:3, 3] - right[:3, 3]) == pytest.approx(0.8, abs=1e-6)


def test_an_input_is_set(cell: Cell, page: Page) -> None:
    page.click("I/O")
    page.wait_for_text("Lamp.Request")
    page.opened.run("[...document.querySelectorAll('input[type=checkbox]')].find(one => one.offsetParent).click()")
    with PadClient(cell.pad, robot="left") as pad:
        for shown in pad.states():
            if shown["left"]["io"]["Lamp.Request"]["value"] is True:
                break


def test_a_push_with_the_mouse_is_felt(cell: Cell, page: Page) -> None:
    with ServoClient(f"{cell.host}:30300", role=Role.OBSERVER) as observer:
        flange = observer.read_state().flange_in_base.position_m
        at = pixel(page, (flange[0], flange[1] + 0.4, flange[2]), camera_for(station_robots(cell.file)))
        # A browser that draws slowly may not have seen what is below the mouse yet.
        strongest = next((force for _ in range(_TRIES) if (force := dragged(page, at, observer)) > 20.0), 0.0)
        page.wait_ms(800)
        left = math.hypot(*felt(observer))
    assert strongest > 20.0
    assert left < 5.0


def dragged(page: Page, at: tuple[float, float], observer: ServoClient) -> float:
    """Drag what is at a place downwards, and let it go; return the strongest force that was felt meanwhile, N."""
    page.move(at)
    page.wait_ms(300)
    page.press(at)
    for step in range(1, 9):
        page.move((at[0], at[1] + 15 * step), buttons=1)
        page.wait_ms(60)
    strongest = max(math.hypot(*felt(observer)) for _ in range(20))
    page.let_go((at[0], at[1] + 120))
    return strongest


def felt(observer: ServoClient) -> tuple[float, ...]:
    state = observer.wait_for_state()
    assert state is not None
    return state.flange_force[:3]


def pixel(page: Page, point: tuple[float, float, float], camera: Camera) -> tuple[float, float]:
    """Return where a point of the scene is on the page, from the camera that the page begins with."""
    eye, target = np.array(camera.position_m), np.array(camera.looks_at_m)
    width, height = page.opened.run(
        "(() => { const box = [...document.querySelectorAll('canvas')].map(one => one.getBoundingClientRect())"
        ".sort((a, b) => b.width - a.width)[0]; return [box.width, box.height]; })()"
    )
    forward = (target - eye) / np.linalg.norm(target - eye)
    sideways = np.cross(forward, [0.0, 0.0, 1.0])
    sideways /= np.linalg.norm(sideways)
    upwards = np.cross(sideways, forward)
    away = np.array(point) - eye
    scale = height / 2.0 / math.tan(FIELD_OF_VIEW_RAD / 2.0) / (away @ forward)
    return float(width / 2.0 + scale * (away @ sideways)), float(height / 2.0 - scale * (away @ upwards))


def test_a_lost_robot_is_red_until_it_is_back(cell: Cell, page: Page) -> None:
    page.click("Rendering")
    page.wait_for_text("connected")
    cell.controller.send_signal(signal.SIGKILL)
    finish(cell.controller)
    page.wait_for_text("LOST")
    red = page.wait_until(
        "[...document.querySelectorAll('tr')].filter(one => one.style.color).map(one => one.innerText)"
    )
    assert sorted(re.split(r"\s", row)[0] for row in red) == ["left", "right"]
    cell.controller = cell.start()
    page.wait_until("!document.body.innerText.includes('LOST')")
    page.click("Refresh")
    # The panel is made anew, and begins with its first tab; what is clicked before that is lost.
    page.wait_until_complete()
    page.click("Rendering")
    page.wait_until("document.body.innerText.split('connected').length === 3")
