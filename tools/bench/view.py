"""``hil bench view``: pictures a second of the page while arms move, and what drawing them costs."""

import math
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import starmap
from pathlib import Path
from statistics import median
from typing import Any, Final, Self

from hil.client.pad import PadClient
from hil.client.servo import PTP, HilError, ServoClient, SmartServo
from hil.clock import MonotonicClock
from hil.values.errors import EndpointError
from tools.bench.bounds import PICTURES_PER_S, Bound, at_least
from tools.bench.page import WatchedPage, controller_with_words, is_software, open_page, wait_for_page
from tools.bench.processor import children, processor_s
from transport.udp import free_port

_HOST: Final = "127.0.0.1"
_APART_MM: Final = 1200
_BEGIN_DEG: Final = (0.0, 30.0, 0.0, -60.0, 0.0, 60.0, 0.0)
_SWING_DEG: Final = (25.0, 12.0, 15.0, 15.0, 20.0, 15.0, 40.0)
_FREQUENCY_HZ: Final = 0.2
_DESTINATIONS_S: Final = 0.05
_WATCHDOG_MS: Final = 1000
"""Drawing may take all cores; the arm must go on moving."""
_LEAST_MESHES: Final = 8
"""Of an arm that is there: base and seven links have at least one each."""
_SETTLE_S: Final = 6.0
"""Until viser has chosen its pixel ratio: it looks for two and a half seconds at a time."""
_BYTES_S: Final = 3.0
_UNDRAWN_S: Final = 4.0
_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class ArmsReport:
    """The page with so many arms moving; processor times are shares of one core."""

    arms: int
    seconds: float
    pictures_per_s: list[int]
    moved_per_s: list[int]
    """Pictures of each second in which the arms stood elsewhere than in the one before."""
    undrawn_per_s: list[int]
    """The same with nothing drawn: what the view and the page manage without the drawing."""
    longest_gap_ms: float
    calls: float
    triangles: float
    pixel_ratio: float
    view_process: float | None
    browser: dict[str, float]
    bytes_per_s: float

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for JSON."""
        return {
            "arms": self.arms,
            "seconds": round(self.seconds, 1),
            "pictures_per_s": _median_and_least(self.pictures_per_s),
            "moved_per_s": _median_and_least(self.moved_per_s),
            "moved_per_s_nothing_drawn": _median_and_least(self.undrawn_per_s),
            "longest_gap_ms": round(self.longest_gap_ms, 1),
            "draw_calls": self.calls,
            "triangles": self.triangles,
            "pixel_ratio": self.pixel_ratio,
            "view_process_cores": None if self.view_process is None else round(self.view_process, 3),
            "browser_cores": {kind or "browser": round(cores, 3) for kind, cores in self.browser.items()},
            "browser_all_cores": round(sum(self.browser.values()), 3),
            "kilobytes_per_s": round(self.bytes_per_s / 1000.0, 1),
        }


@dataclass(frozen=True, slots=True)
class ViewReport:
    """What was seen, with one arm and with more."""

    browser: str
    renderer: str
    arms: tuple[ArmsReport, ...]

    @property
    def software(self) -> bool:
        """Whether the browser drew with the processor."""
        return is_software(self.renderer)

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [
            at_least(f"pictures a second, {one.arms} arms, median", median(one.pictures_per_s), PICTURES_PER_S, "")
            for one in self.arms
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "browser": self.browser,
            "renderer": self.renderer,
            "drawn_in_software": self.software,
            "runs": [one.as_dict() for one in self.arms],
            "bounds": [bound._asdict() for bound in self.bounds()],
        }


def bench_view(*, robot: str, most_arms: int, seconds: float, progress: Callable[[float], None]) -> ViewReport:
    """Watch the page for ``seconds`` with one arm, then with each number up to ``most_arms``; tell the seconds done."""
    runs: list[ArmsReport] = []
    browser = renderer = ""
    for arms in range(1, most_arms + 1):
        with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as opened:
            process, address = opened.enter_context(_controller(Path(folder), robot, arms))
            pad = Path(folder, "pad.sock")
            movers = [opened.enter_context(_Mover(servo)) for servo in _servo_addresses(pad)]
            page = opened.enter_context(open_page(address, reaches=_HOST))
            page.wait_until_drawn(_LEAST_MESHES * arms)
            page.let_pass(_SETTLE_S)
            browser, renderer = page.version, page.renderer
            runs.append(_watch(page, process.pid, arms, seconds))
            for mover in movers:
                mover.check()
        progress(arms * seconds)
    return ViewReport(browser, renderer, tuple(runs))


def length_s(most_arms: int, seconds: float) -> float:
    """Return what ``progress`` is told at the end."""
    return most_arms * seconds


def _watch(page: WatchedPage, controller: int, arms: int, seconds: float) -> ArmsReport:
    [view] = children(controller, saying="view") or [0]
    used_before = processor_s(view)
    watched = page.watch(seconds)
    used = processor_s(view)
    if not watched.pictures:
        raise EndpointError(f"the page drew nothing within {seconds:g} s")
    pixel_ratio, bytes_per_s = page.pixel_ratio, page.bytes_a_second(_BYTES_S)
    page.draw_nothing()
    undrawn = page.watch(_UNDRAWN_S)
    return ArmsReport(
        arms,
        watched.seconds,
        watched.per_second(),
        watched.per_second(moved=True),
        undrawn.per_second(moved=True),
        watched.longest_gap_ms(),
        median(picture.calls for picture in watched.pictures),
        median(picture.triangles for picture in watched.pictures),
        pixel_ratio,
        (sum(used.values()) - sum(used_before.values())) / watched.seconds if used_before else None,
        {kind: used_s / watched.seconds for kind, used_s in watched.browser_s.items()},
        bytes_per_s,
    )


def _median_and_least(counted: list[int]) -> dict[str, float]:
    return {"median": median(counted), "slowest": min(counted)}


@contextmanager
def _controller(folder: Path, robot: str, arms: int) -> Iterator[tuple["subprocess.Popen[bytes]", str]]:
    """Run the controller of so many arms with its page; yield it, and the operator's address of the page."""
    station, said = folder / "station.toml", folder / "said"
    station.write_text("".join(_robot(number, robot) for number in range(arms)), encoding="utf-8")
    arguments: list[object] = [
        station,
        "--progress",
        0,
        "--view-at",
        f"{_HOST}:{free_port(_HOST)}",
        "--pad",
        folder / "pad.sock",
    ]
    with controller_with_words(said, *arguments) as process:
        yield process, wait_for_page(process, said)


def _robot(number: int, model: str) -> str:
    return (
        f'[[robot]]\nname = "arm{number + 1}"\nmodel = "{model}"\n'
        f'[robot.base]\ny_mm = {number * _APART_MM}\n[robot.servo]\nbind = "{_HOST}:0"\n'
    )


def _servo_addresses(pad: Path) -> list[str]:
    with PadClient(pad) as asked:
        told = asked.describe()["robots"].values()
    return [robot["servo"] for robot in told if robot["servo"] is not None]


class _Mover:
    """Moves all axes of an arm to and fro, in a thread of its own, while the context is open."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._ended = threading.Event()
        self._failed: HilError | None = None
        self._thread = threading.Thread(target=self._run, name=f"moves {address}", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def check(self) -> None:
        """Raise what ended the motion early."""
        if self._failed is not None:
            raise self._failed

    def _run(self) -> None:
        try:
            self._move()
        except HilError as error:
            self._failed = error

    def _move(self) -> None:
        clock = MonotonicClock()
        with ServoClient(self._address, name="bench", state_period_ms=20, watchdog_ms=_WATCHDOG_MS) as client:
            client.move(PTP(tuple(map(math.radians, _BEGIN_DEG))))
            motion = SmartServo().set_timeout_after_goal_reach(3600)
            client.move_async(motion)
            runtime = motion.get_runtime()
            start = runtime.get_command_result_of_interpolation()
            began_ns = clock.now_ns()
            while not self._ended.wait(_DESTINATIONS_S):
                turn = math.sin(2.0 * math.pi * _FREQUENCY_HZ * (clock.now_ns() - began_ns) / _NS)
                swings = (math.radians(swing) * turn for swing in _SWING_DEG)
                runtime.set_destination(tuple(starmap(float.__add__, zip(start, swings, strict=True))))
            runtime.stop_motion()
