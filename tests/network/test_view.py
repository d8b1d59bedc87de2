"""``hil view`` in a real browser beside a real controller: what is drawn, what the pad does, and what it lets go."""

import contextlib
import math
import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from backends.robots.visual import visual_parts
from hil.client.pad import PadClient, PadRefused
from hil.client.servo import CommandInvalidException, Role, ServoClient, SmartServo, Snapshot
from tests.support.chromium import CHROMIUM, NO_CHROMIUM, Browser
from tests.support.page import Page
from tests.support.processes import finish, hil, own_host, wait_for_line
from tools.view.link_poses import LinkPoses
from transport.udp import free_port

pytestmark = [pytest.mark.alone, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]

ROBOT = "lbr-iiwa-14-r820"


class Station:
    """A controller with its page."""

    def __init__(self, process: "subprocess.Popen[str]", host: str, pad: Path, lines: list[str]) -> None:
        self.process, self.host, self.pad = process, host, pad
        told = next(line for line in lines if "?websocket=" in line)
        found = re.search(r"(http://\S+)/\?websocket=ws://\S+/(\w+)", told)
        assert found, told
        self.address, self.operator_address, self.token = found[1], told.split()[1], found[2]

    def state(self) -> Snapshot:
        with ServoClient(self.host, role=Role.OBSERVER) as observer:
            return observer.read_state()

    def moved_flange(self) -> float:
        """Return how fast the flange is now, mm/s."""
        return self.state().flange_speed_mm_s


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where screenshots go: a folder of the run, or the one that HIL_SCREENSHOTS names, to be looked at."""
    kept = os.environ.get("HIL_SCREENSHOTS")
    folder = Path(kept) if kept else tmp_path_factory.mktemp("screens")
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def station() -> Iterator[Station]:
    host = own_host()
    with tempfile.TemporaryDirectory(prefix="pad") as folder:
        pad = Path(folder, "pad.sock")
        process = hil(
            "run", "--fri-client", "off", "--mode", "T1", "--servo", host, "--pad", pad, "--cycle", 2,
            "--view-at", f"{host}:{free_port(host)}", "--progress", 0, "--robot", ROBOT,
        )  # fmt: skip
        lines = wait_for_line(process, "?websocket=")
        yield Station(process, host, pad, lines)
        ended = finish(process, interrupt=True)
        assert ended.code == 0, ended.err


@pytest.fixture(scope="module")
def browser(station: Station, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("chromium"), reaches=[station.host]) as opened:
        yield opened


@pytest.fixture
def operated(station: Station, browser: Browser) -> Iterator[Page]:
    """The operator's page, and an arm that has no stop to be acknowledged, in T1."""
    with PadClient(station.pad) as pad:
        for key in (pad.reset, pad.release):
            with contextlib.suppress(PadRefused):
                key()
        with contextlib.suppress(PadRefused):
            pad.select_mode("T1")
    page = Page(browser, station.operator_address)
    page.wait_until_complete()
    yield page
    page.close()


def wait_for_pad(station: Station, **wanted: object) -> None:
    """Wait until the pad shows it."""
    with PadClient(station.pad) as pad:
        for shown in pad.states():
            if all(shown["arm"][name] == value for name, value in wanted.items()):  # type: ignore[literal-required]
                return


def test_the_arm_is_drawn_where_the_state_packet_says(station: Station, operated: Page) -> None:
    jog(operated, "A2", "A2 +", for_ms=900)
    operated.wait_ms(400)
    state = station.state()
    assert state.measured_position[1] > math.radians(31.0)
    # Parts may have as many vertices as others: the base is drawn first, the last link last.
    parts = visual_parts(ROBOT)
    foot, flange = operated.drawn(len(parts[0].vertices))[0], operated.drawn(len(parts[-1].vertices))[-1]
    link_in_base = np.linalg.inv(matrix(foot)) @ matrix(flange)
    drawn = link_in_base @ [*flange_in_last_link(), 1.0]
    assert drawn[:3] == pytest.approx(state.flange_in_base.position_m, abs=1e-3)


def matrix(columns: list[float]) -> NDArray[np.float64]:
    return np.array(columns).reshape(4, 4).T


def flange_in_last_link() -> list[float]:
    poses = LinkPoses(ROBOT)
    [*_, link] = poses.at((0.0,) * 7)
    return [there - here for there, here in zip(poses.flange_m(), link.position_m, strict=True)]


def jog(page: Page, axis: str, key: str, *, for_ms: float) -> None:
    page.click("Jog")
    page.click(axis, kind="label, button")
    at = page.place(f"{key}: hold")
    page.press(at)
    page.wait_ms(for_ms)
    page.let_go(at)


def test_a_jog_key_moves_the_axis_as_long_as_it_is_held(station: Station, operated: Page) -> None:
    before = station.state()
    jog(operated, "A4", "A4 −", for_ms=1200)
    wait_for_pad(station, enabling=False)
    operated.wait_ms(300)
    after = station.state()
    assert math.degrees(before.measured_position[3] - after.measured_position[3]) > 2.0
    assert after.flange_speed_mm_s < 1.0
    assert after.commander == ""
    with PadClient(station.pad) as pad:
        margins = pad.status()["arm"]["margins"]
    assert 0.0 < margins["T1, commanded"]["used"] < 0.9


def test_closing_the_browser_in_mid_jog_stops_the_arm(station: Station, operated: Page, browser: Browser) -> None:
    page = Page(browser, station.operator_address)
    page.wait_until_complete()
    page.click("Jog")
    at = page.place("A1 +: hold")
    page.press(at)
    page.wait_until("document.body.innerText.includes('RUNNING')")
    page.wait_ms(500)
    with ServoClient(station.host, role=Role.OBSERVER, state_period_ms=10) as observer:
        moving = observer.read_state()
        assert moving.operator.enabling
        page.close()
        for state in observer.states():
            if not state.operator.enabling and state.flange_speed_mm_s < 0.5:
                break
        assert (state.now_ns - moving.now_ns) / 1e9 < 2.0


def test_the_emergency_stop_stops_a_moving_arm(station: Station, operated: Page) -> None:
    operated.click("AUT", kind="label, button")
    operated.click("Start", kind="label, button")
    wait_for_pad(station, mode="AUT", program="RUNNING")
    with ServoClient(station.host) as application:
        here = list(application.read_state().commanded_position)
        here[0] += 1.2
        motion = SmartServo(here).set_joint_velocity_rel(0.15)
        application.move_async(motion)
        at = operated.place("EMERGENCY STOP")
        operated.wait_until("parseFloat(document.querySelector('[data-hil=speed]').textContent) > 20")
        operated.press(at)
        operated.let_go(at)
        with pytest.raises(CommandInvalidException, match="emergency stop was pressed"):
            motion.wait_until_ended(timeout_s=5)
    wait_for_pad(station, program="EMERGENCY_STOP")
    with ServoClient(station.host, role=Role.OBSERVER) as observer:
        stopped = next(state for state in observer.states() if state.flange_speed_mm_s < 1.0)
    assert stopped.measured_position[0] < here[0] - 0.1
    operated.wait_for_text("the emergency stop was pressed")
    operated.click("Reset", kind="label, button")
    wait_for_pad(station, program="PAUSED")


def test_who_has_no_token_only_looks(station: Station, operated: Page, browser: Browser) -> None:
    page = Page(browser, station.address)
    page.wait_for_text("operator's token")
    page.wait_until_complete()
    assert acting(page) == []
    page.type("q" * len(station.token), into="operator's token")
    page.wait_for_text("that is not the operator's token")
    assert acting(page) == []
    page.close()
    page = Page(browser, station.address)
    page.wait_until_complete()
    page.type(station.token, into="operator's token")
    page.wait_for_text("EMERGENCY STOP")
    page.close()


def acting(page: Page) -> list[str]:
    """Return the buttons and tabs that do something to the robot."""
    told: list[str] = page.opened.run(
        "[...document.querySelectorAll('button, [role=tab], label')].map(one => one.textContent.trim())"
    )
    return [text for text in told if re.search("EMERGENCY|hold|Start|Pause|^Reset$|AUT|T1|Jog|scene|Refresh", text)]


def test_a_picture_of_every_screen(station: Station, operated: Page, browser: Browser, pictures: Path) -> None:
    for tab in ("Axes", "Jog", "I/O", "Messages", "Latency", "View", "Rendering"):
        operated.click(tab)
        operated.wait_ms(300)
        picture = operated.picture(pictures / f"operator-{tab.replace('/', '')}.png")
        assert picture.stat().st_size > 30_000
    page = Page(browser, station.address)
    page.wait_for_text("operator's token")
    page.wait_ms(1500)
    assert page.picture(pictures / "to-look-at.png").stat().st_size > 30_000
    assert not page.opened.told("Runtime.exceptionThrown")
    page.close()
