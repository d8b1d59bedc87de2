"""The feedback effect in a running controller: the manual's loop as an application, FRI clients, swings on purpose."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import pytest

from apps._servo_sample import START_DEG, Sine, run_sample
from apps.visual_servoing import Loop, Motion, Outcome, Run, outcome, sentence, track
from backends.ideal import IdealBackend
from hil.client.servo import PTP, ServoClient, SmartServo, StatisticTimer
from hil.core.events import Diagnosed
from hil.core.settings import FriSettings
from hil.values.fri import OverlayKind, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage
from tests.support.virtual import PEER, Bench
from tests.support.virtual_controller import controller

Change = Callable[[CommandMessage, MonitoringMessage], CommandMessage]
START_RAD = tuple(map(math.radians, START_DEG))


def loop(gain: float, **more: Any) -> Loop:
    keys: dict[str, Any] = {
        "axis": 1,
        "period_s": 0.1,
        "camera_steps": 1,
        "processing_steps": 1,
        "target_deg": 0.1,
        "noise_pixels": 0.5,
        "limit_deg": 2.4,
        "seed": 1,
    }
    return Loop(gain=gain, **keys | more)


def servo(
    made: Loop, *, motion: Motion = Motion.DIRECT_SERVO, seconds: float = 5.0, backend: str = "ideal"
) -> tuple[Run, Outcome, list[dict[str, Any]], list[str]]:
    """Run the application in virtual time; return what it saw, and what the controller found and told."""
    with controller(backend=backend, cycle_ms=5, fri={"send_period_ms": 5}, servo={}) as robot_controller:
        with ServoClient() as robot:
            robot.move(PTP(START_RAD))
            carries = motion.make()
            robot.move_async(carries)
            run = track(carries.get_runtime(), made, seconds=seconds, timing=StatisticTimer())
            carries.stop_motion()
        report = robot_controller.report()
        assert report["stops"] == []
        # An arm that is quick enough to be one dead time stands before each destination, which is found too.
        findings = [found for found in report["findings"] if found["kind"] != "seconds-hand"]
        return run, outcome(run, made), findings, robot_controller.told()


@pytest.mark.parametrize(("gain", "motion"), [(0.6, Motion.DIRECT_SERVO), (0.9, Motion.SMART_SERVO)])
def test_the_manuals_loop_settles_below_one_and_nothing_is_found(gain: float, motion: Motion) -> None:
    made = loop(gain)
    run, seen, findings, _ = servo(made, motion=motion)
    assert findings == []
    assert not run.stopped
    assert seen.error_deg == pytest.approx(0.1 / (1.0 + gain), abs=0.02)
    assert sentence(run, made, seen, seconds=5.0).startswith("kept within 2.4 degrees for 5 s: ")


@pytest.mark.parametrize(
    ("gain", "motion", "backend"),
    [
        (1.3, Motion.DIRECT_SERVO, "ideal"),
        (1.5, Motion.SMART_SERVO, "mujoco"),
    ],
)
def test_the_manuals_loop_swings_up_above_one_and_both_sides_say_so(gain: float, motion: Motion, backend: str) -> None:
    made = loop(gain)
    run, seen, findings, told = servo(made, motion=motion, backend=backend)
    assert run.stopped
    assert seen.growth == pytest.approx(gain**2, rel=0.1)
    assert seen.period_s == pytest.approx(0.6, rel=0.1)
    said = sentence(run, made, seen, seconds=5.0)
    assert said.startswith(
        f"stopped: the loop is unstable with the gain {gain:g}, where below 1 is stable (manual 7.11)"
    )
    [found] = findings
    assert (found["kind"], found["severity"], found["whose"]) == ("feedback-oscillation", "fault", "application")
    figures = found["figures"]
    assert figures["axis"] == "A1"
    assert figures["frequency_hz"] == pytest.approx(1.0 / 0.6, rel=0.1)
    assert figures["growth_per_period"] == pytest.approx(gain**2, rel=0.2)
    assert figures["loop_gain_about"] == pytest.approx(gain, rel=0.1)
    assert found["sentence"] == (
        f"A1 oscillates at {figures['frequency_hz']:.3g} Hz and grows by {figures['growth_per_period']:.2f} a period: "
        "the application's loop is unstable (feedback effect, manual 7.11); its gain is about "
        f"{figures['loop_gain_about']:.2f} where below 1 is stable"
    )
    assert any("A1 oscillates at " in line and "check the control law" in line for line in told)
    remedies = found["remedies"]
    assert remedies[0].startswith("in the application: check the control law, and reduce its gain to below about 0.")
    assert remedies[1] == "lower the program override, now 100 %"
    quicker = "or make the arm quicker: raise set_joint_jerk, now 500 %, at most 1500 %"
    assert (remedies[-1] == quicker) is (motion is Motion.SMART_SERVO)
    assert len(remedies) == (4 if motion is Motion.SMART_SERVO else 3)


def test_the_sample_that_goes_to_and_fro_is_no_finding() -> None:
    for frequency_hz, period_s in ((0.5, 0.02), (2.0, 0.01)):
        with controller(backend="ideal", cycle_ms=2, fri={"send_period_ms": 2}, servo={}) as robot_controller:
            run_sample(
                SmartServo().set_minimum_trajectory_execution_time(0.02),
                Sine(4, 0.02, frequency_hz),
                controller="127.0.0.1:30300",
                key_file=None,
                seconds=3.0,
                period_s=period_s,
                say=lambda _: None,
            )
            assert all(found["severity"] == "note" for found in robot_controller.report()["findings"])
            assert frequency_hz > 1.0 or robot_controller.report()["findings"] == []


def fri_bench(change: Change | None = None, *, overlay: OverlayKind = OverlayKind.JOINT_POSITION) -> Bench:
    bench = Bench(backend=IdealBackend, fri=FriSettings(peer=PEER, send_period_ms=5, overlay=overlay))
    if change is not None:
        bench.client.change = change
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    return bench


def findings_of(bench: Bench) -> list[dict[str, Any]]:
    findings = bench.report()["findings"]
    assert isinstance(findings, list)
    return findings


@pytest.mark.parametrize("frequency_hz", [0.25, 1.0])
def test_an_fri_joint_sine_is_no_finding(frequency_hz: float) -> None:
    bench = fri_bench()
    bench.client.frequency_hz, bench.client.amplitude_rad = frequency_hz, 0.03
    bench.run(6.0)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    assert findings_of(bench) == []


class FeedsBack:
    """An FRI client that commands A2 against what was measured ``answers`` answers ago, after a push at the start."""

    def __init__(self, gain: float, *, answers: int) -> None:
        self._gain = gain
        self._seen: deque[float] = deque([0.0] * answers)
        self._count = 0

    def __call__(self, command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        assert message.connection is not None
        if message.connection.session_state != SessionState.COMMANDING_ACTIVE:
            return command
        assert message.ipo is not None
        assert message.ipo.position is not None
        assert message.monitor is not None
        assert message.monitor.measured_position is not None
        hold = message.ipo.position
        if not self._count:
            self._hold = message.monitor.measured_position
        push = 4e-4 * math.sin(math.pi * self._count / 10) if self._count < 10 else 0.0
        self._count += 1
        self._seen.append(message.monitor.measured_position[1] - self._hold[1])
        offset = push - self._gain * self._seen.popleft()
        position = (*hold[:1], self._hold[1] + min(max(offset, -0.01), 0.01), *hold[2:])
        return command._replace(command=CommandData(position=position))


def test_an_fri_client_that_feeds_its_measured_position_back_is_found() -> None:
    stable = fri_bench(FeedsBack(0.7, answers=8))
    stable.run(3.0)
    assert findings_of(stable) == []
    bench = fri_bench(FeedsBack(1.3, answers=8))
    bench.run(1.5)
    found = findings_of(bench)[0]
    assert (found["subject"], found["severity"]) == ("FRI overlay, A2", "fault")
    told = [str(event) for event in bench.events if isinstance(event, Diagnosed)]
    assert told[0].startswith("A2 oscillates at "), told
    assert "answer sooner: the loop takes " in found["remedies"][-1]
