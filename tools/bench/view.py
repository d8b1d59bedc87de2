"""``hil bench view`` and ``hil bench rate --view``: how smooth the page is, and what it costs the controller."""

import os
import statistics
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, NamedTuple

from hil.client.servo import ServoClient, SmartServo
from hil.values.errors import EndpointError, HilError
from hil.values.fri import Release
from tools.bench.bounds import Bound, at_least
from tools.bench.browser import CHROMIUM, BenchBrowser
from tools.bench.rate import bench_rate, start_process
from tools.bench.waiting import wait_for
from transport.udp import free_port

FRAMES_PER_S: Final = 30.0
_HOST: Final = "127.0.0.1"
_START_S: Final = 20.0
_SWING_RAD: Final = 0.5
_SWING_S: Final = 2.0
_VELOCITY_REL: Final = 0.2
_COUNTS: Final = """
window.draws = 0;
for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
    const draw = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) { window.draws++; return draw.apply(this, given); };
}
"""
"""A frame counts where something was drawn in it, not where the browser was only asked whether there is anything."""
_MEASURE: Final = """
new Promise(done => {
    const counts = [];
    let frames = 0, calls = 0, last = window.draws, begun = performance.now();
    function frame() {
        if (window.draws > last) { frames++; calls += window.draws - last; }
        last = window.draws;
        const passed = performance.now() - begun;
        if (passed >= 1000) {
            counts.push([frames * 1000 / passed, frames ? calls / frames : 0]);
            frames = calls = 0;
            begun = performance.now();
        }
        if (counts.length >= SECONDS) done(counts); else requestAnimationFrame(frame);
    }
    requestAnimationFrame(frame);
})
"""
_RENDERER: Final = """
(() => {
    const context = document.createElement("canvas").getContext("webgl2");
    const told = context && context.getExtension("WEBGL_debug_renderer_info");
    return context ? context.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : context.RENDERER) : "none";
})()
"""


class ViewReport(NamedTuple):
    """How smooth the page was; ``fps`` of each second that was measured."""

    arms: int
    fps: tuple[float, ...]
    draw_calls: float
    """A frame, median."""
    renderer: str
    view_cpu: float
    """Share of a core that the view's process took."""

    def bound(self) -> Bound:
        """Return the bound of the frames a second."""
        return at_least(f"frames a second, {self.arms} arms, median", statistics.median(self.fps), FRAMES_PER_S, "1/s")


def bench_view(*, arms: int, seconds: float, progress: Callable[[str], None]) -> ViewReport:
    """Let arms swing in a controller, and count the frames that a headless Chromium draws of them."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as stack:
        station, pad, port = Path(folder, "station.toml"), Path(folder, "pad.sock"), free_port(_HOST)
        servo = [f"{_HOST}:{free_port(_HOST)}" for _ in range(arms)]
        station.write_text("\n".join(_robot(number, address) for number, address in enumerate(servo)))
        progress("controller")
        run = ("run", station, "--pad", pad, "--progress", 0, "--cycle", 2)
        stack.enter_context(_ended(start_process("hil.cli.main", *run)))
        wait_for(pad.exists, _START_S, "the controller")
        progress("view")
        view = stack.enter_context(
            _ended(start_process("hil.cli.main", "view", "--socket", pad, "--host", _HOST, "--port", port))
        )
        wait_for(lambda: _listens(port), _START_S, "the page")
        for address in servo:
            stack.enter_context(_swinging(address))
        progress("browser")
        browser = stack.enter_context(BenchBrowser(f"http://{_HOST}:{port}", before=_COUNTS))
        wait_for(
            lambda: browser.run("document.body !== null && document.body.innerText.includes('between its ends')"),
            _START_S,
            "the panel",
        )
        browser.run("new Promise(done => setTimeout(done, 2000))")
        progress("measuring")
        before_s = _cpu_s(view.pid)
        counts: list[list[float]] = browser.run(_MEASURE.replace("SECONDS", str(max(1, round(seconds)))))
        used_s = _cpu_s(view.pid) - before_s
        return ViewReport(
            arms,
            tuple(round(fps, 1) for fps, _ in counts),
            round(statistics.median(calls for _, calls in counts), 1),
            str(browser.run(_RENDERER)),
            round(used_s / max(1.0, float(len(counts))), 3),
        )


class Beside(StrEnum):
    """What runs beside the controller."""

    NOTHING = "nothing"
    VIEW = "view"
    BROWSER = "view and browser"


class PacingRun(NamedTuple):
    """One run of ``hil bench rate``."""

    beside: Beside
    robot: dict[str, Any]

    @property
    def lateness_p99_us(self) -> float:
        """Lateness that one cycle of a hundred has."""
        return float(self.robot["lateness_us"]["p99"])

    @property
    def missed_percent(self) -> float:
        """Cycles missed."""
        return 100.0 * float(self.robot["missed_cycles"]) / float(self.robot["ticks"])


def bench_rate_with_view(
    *,
    robot: str,
    backend: str,
    release: Release,
    seconds: float,
    repeats: int,
    progress: Callable[[float], None],
) -> list[PacingRun]:
    """Run ``hil bench rate`` in turn with nothing, with the view, and with a browser that shows the page."""
    kinds = [one for one in Beside if one is not Beside.BROWSER or CHROMIUM is not None]
    runs: list[PacingRun] = []
    for _ in range(repeats):
        for kind in kinds:
            done = len(runs) * seconds
            with ExitStack() as stack:
                at = None if kind is Beside.NOTHING else free_port(_HOST)
                if kind is Beside.BROWSER:
                    stack.enter_context(_browser_at(at))
                report = bench_rate(
                    robot=robot,
                    backend=backend,
                    release=release,
                    seconds=seconds,
                    capture=False,
                    realtime=False,
                    view_port=at,
                    progress=lambda passed, done=done: progress(done + passed),  # type: ignore[misc]
                )
            runs.append(PacingRun(kind, report.robot))
    return runs


def verdict(runs: Sequence[PacingRun], kind: Beside) -> str:
    """Say in words whether what runs beside the controller is seen in its pacing, by the spread of what is measured."""
    alone = [run.lateness_p99_us for run in runs if run.beside is Beside.NOTHING]
    beside = [run.lateness_p99_us for run in runs if run.beside is kind]
    spread = max(alone) - min(alone)
    more = statistics.median(beside) - statistics.median(alone)
    judged = "within the noise" if more <= spread else "more than the noise"
    return (
        f"{kind}: p99 of the lateness {more:+.0f} us; runs of the same kind differ by up to {spread:.0f} us: {judged}"
    )


@contextmanager
def _browser_at(port: int | None) -> Iterator[None]:
    """Open the page as soon as it is served, in a thread, because the controller is not started yet."""
    ended = threading.Event()

    def show() -> None:
        try:
            wait_for(lambda: ended.is_set() or _listens(port), _START_S, "the page")
            with BenchBrowser(f"http://{_HOST}:{port}"):
                ended.wait()
        except HilError:
            if not ended.is_set():
                raise

    thread = threading.Thread(target=show, name="browser")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def _swinging(address: str) -> Iterator[None]:
    """Let one arm go to and fro until the end of the block."""
    ended = threading.Event()

    def swing() -> None:
        with ServoClient(address, name="bench") as client:
            here = list(client.read_state().commanded_position)
            motion = SmartServo().set_joint_velocity_rel(_VELOCITY_REL)
            client.move_async(motion)
            runtime, side = motion.get_runtime(), 1.0
            while not ended.wait(_SWING_S):
                runtime.set_destination(
                    [here[0] + side * _SWING_RAD, *here[1:3], here[3] + side * _SWING_RAD, *here[4:]]
                )
                side = -side

    thread = threading.Thread(target=swing, name=f"swings {address}")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def _ended(process: "subprocess.Popen[bytes]") -> Iterator["subprocess.Popen[bytes]"]:
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _robot(number: int, address: str) -> str:
    return (
        f'[[robot]]\nname = "arm{number + 1}"\n[robot.base]\ny_mm = {900 * number}\n[robot.servo]\nbind = "{address}"\n'
    )


def _listens(port: int | None) -> bool:
    import socket

    with socket.socket() as trial:
        trial.settimeout(0.2)
        return trial.connect_ex((_HOST, port or 0)) == 0


def _cpu_s(process: int) -> float:
    """Return the processor time of a process and its threads so far; Linux."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError as error:
        raise EndpointError(f"the processor time of process {process} cannot be read: {error.strerror}") from error
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
