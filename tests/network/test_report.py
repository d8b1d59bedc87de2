"""The page of ``hil report`` in a real browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from hil.values.operator import PadKey, Press
from tests.support.chromium import CHROMIUM, NO_CHROMIUM, Browser, Opened
from tests.support.cli import cli
from tests.support.recordings import fri_robot, record

HOSTILE = "<img src=http://fri-hil.invalid/name>"
DRAWN = 'document.documentElement.dataset.drawn || !document.getElementById("undrawn").hidden'
PANELS = """[...document.querySelectorAll(".plot")].map((plot) => ({
  name: plot.dataset.panel, width: plot.clientWidth, over: plot.querySelector("svg").clientWidth - plot.clientWidth,
  lines: plot.querySelectorAll(".scatterlayer path.js-line").length, points: plot.querySelectorAll("path.point").length,
  bars: plot.querySelectorAll(".bars .point").length, range: plot.layout.xaxis.range,
  texts: [...plot.querySelectorAll("text")].map((text) => text.textContent),
}))"""
ANSWERS = """JSON.parse(document.getElementById("data").textContent).robots[0].bars
  .reduce((sum, bar) => sum + bar[2], 0)"""

pytestmark = [pytest.mark.alone, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("chromium")) as opened:
        yield opened


def panels(page: Opened) -> dict[str, Any]:
    return {panel["name"]: panel for panel in page.run(PANELS)}


def until(page: Opened, condition: str) -> None:
    """Wait until an expression is true; pytest's timeout ends what never comes."""
    page.run(f"new Promise((done) => {{ const look = () => {condition} ? done() : setTimeout(look, 20); look(); }})")


def test_the_page_is_drawn_and_asks_nobody(tmp_path: Path, browser: Browser) -> None:
    file = record(
        tmp_path / "run.pcapng",
        fri_robot(name=HOSTILE, fri={"send_period_ms": 5, "quality_rise_ms": 40}),
        1.0,
        during=lambda run: run.operate(Press(PadKey.EMERGENCY_STOP)),
    )
    ended = cli("report", file, "-o", tmp_path / "run.html")
    assert ended.code == 0, ended.err
    page = browser.open(tmp_path / "run.html")
    until(page, DRAWN)
    assert page.run("document.documentElement.dataset.drawn") == "yes"
    found = panels(page)
    assert list(found) == ["timeline", "latency", "histogram", "positions", "difference", "speed"]
    # Curves, points and bars of the data, and their words: not only empty axes.
    assert [found[name]["lines"] for name in ("positions", "difference", "speed")] == [2, 1, 1]
    assert found["latency"]["points"] == page.run(ANSWERS) > 150
    assert found["histogram"]["bars"] >= 5
    assert "COMMANDING_ACTIVE" in found["timeline"]["texts"]
    assert "T1: 250 mm/s" in found["speed"]["texts"]
    assert "the emergency stop was pressed" in page.run('document.getElementById("verdict").textContent')
    assert page.run('document.querySelector("h2").firstChild.textContent') == f"{HOSTILE} "
    assert page.run('document.querySelectorAll("img").length') == 0
    picture = imread(str(page.picture(tmp_path / "page.png")))
    assert picture.shape[0] > 2000
    assert [float(part.std()) > 0.02 for part in np.array_split(picture[:2000], 4)] == [True] * 4

    # All panels show the same stretch of time; another axis is drawn in it.
    page.run('void Plotly.relayout(document.querySelector("[data-panel=speed]"), {"xaxis.range": [0.3, 0.6]})')
    page.run('document.querySelector(".axes button").click()')
    until(page, f'{PANELS}.every((one) => one.name === "histogram" || one.range[0] === 0.3)')
    until(page, f'{PANELS}[3].texts.includes("A1, rad")')
    zoomed = panels(page)
    assert {tuple(one["range"]) for name, one in zoomed.items() if name != "histogram"} == {(0.3, 0.6)}
    # On a telephone nothing is wider than the page.
    page.call("Emulation.setDeviceMetricsOverride", width=400, height=800, deviceScaleFactor=1, mobile=False)
    until(page, f"{PANELS}.every((one) => one.width < 400 && one.over <= 0)")
    assert page.run("document.documentElement.scrollWidth") <= 400

    assert page.complaints == []
    assert page.asked == []


def test_a_page_that_asks_somebody_is_found_out(tmp_path: Path, browser: Browser) -> None:
    """What the test above looks at does see it: else it would prove nothing."""
    asks = tmp_path / "asks.html"
    asks.write_text(
        "<!DOCTYPE html><title>asks</title><img src='http://fri-hil.invalid/picture.png'>"
        "<script>fetch('http://other.invalid/x').catch(() => console.error('refused'))</script>"
    )
    page = browser.open(asks)
    page.run("fetch('http://third.invalid/').catch(() => 0)")
    assert sorted(page.asked) == [
        "http://fri-hil.invalid/picture.png", "http://other.invalid/x", "http://third.invalid/",
    ]  # fmt: skip
    assert any("refused" in one for one in page.complaints)


def test_the_policy_of_the_page_holds_even_for_what_would_slip_into_it(tmp_path: Path, browser: Browser) -> None:
    """A script and a picture written into a page by force: neither runs, neither is asked for."""
    file = record(tmp_path / "run.pcapng", fri_robot(), 0.05)
    cli("report", file, "-o", tmp_path / "run.html")
    forced = "<script>document.title = 'owned'</script><img src='http://fri-hil.invalid/picture.png'></body>"
    source = (tmp_path / "run.html").read_text(encoding="utf-8")
    (tmp_path / "run.html").write_text(source.replace("</body>", forced), encoding="utf-8")
    page = browser.open(tmp_path / "run.html")
    assert page.run("document.title") == "Run run.pcapng"
    assert page.run("fetch('http://third.invalid/').then(() => 'came', () => 'refused')") == "refused"
    assert len([one for one in page.complaints if "Content Security Policy" in one]) >= 3
