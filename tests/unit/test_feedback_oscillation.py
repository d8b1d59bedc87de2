"""The feedback effect is told from swings that an application commands on purpose, as far as that can be told."""

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.core.diagnosis.feedback_oscillation import SAMPLE_NS, FeedbackOscillation, Oscillation
from hil.core.diagnosis.oscillation_words import oscillation_finding
from hil.core.diagnosis.turning_points import MOST_ROWS, REMEMBERED, TurningPoints
from hil.values.finding import Severity, Whose
from hil.values.fri import SessionState
from tests.support.captures import datagrams, files, release_of
from tests.support.cases import cases
from tests.support.feedback_loops import closed_loop, commanded_on_purpose, on_axis, sine
from transport.fri import FriCodec


def growing(seen: list[tuple[int, Oscillation]]) -> list[Oscillation]:
    return [one for _, one in seen if one.growing]


@settings(max_examples=cases(40), deadline=None)
@given(
    gain=st.floats(1.1, 2.2),
    dead_steps=st.integers(1, 12),
    half_period_ms=st.integers(50, 600),
    axis=st.integers(0, 6),
)
def test_an_unstable_loop_is_named_with_frequency_growth_and_axis(
    gain: float, dead_steps: int, half_period_ms: int, axis: int
) -> None:
    period_ms = max(1, half_period_ms // dead_steps)
    steps = dead_steps * (10 + math.ceil(math.log(400.0) / math.log(gain)))
    seen = growing(
        closed_loop(gain, steps=steps, dead_steps=dead_steps, period_ms=period_ms, limit_rad=10.0, axis=axis)
    )
    assert seen
    for one in seen:
        assert one.axis == axis
        assert one.frequency_hz == pytest.approx(1e3 / (2 * dead_steps * period_ms), rel=0.1)
        assert one.growth == pytest.approx(gain**2, rel=0.2)
        assert one.gain == pytest.approx(gain, rel=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_pixel_noise_alone_sets_an_unstable_loop_off(seed: int) -> None:
    seen = growing(closed_loop(1.3, steps=120, noise_rad=0.0005, target_rad=0.0, seed=seed))
    assert seen
    assert seen[-1].growth == pytest.approx(1.69, rel=0.2)


@settings(max_examples=cases(30), deadline=None)
@given(
    gain=st.floats(0.0, 0.9), dead_steps=st.integers(1, 6), noise_rad=st.sampled_from([0.0, 5e-4]), seed=st.integers()
)
def test_a_stable_loop_is_never_called_unstable(gain: float, dead_steps: int, noise_rad: float, seed: int) -> None:
    seen = closed_loop(gain, steps=400, dead_steps=dead_steps, noise_rad=noise_rad, target_rad=0.05, seed=seed)
    assert growing(seen) == []
    settled = [one for step, one in seen if step > 40 * dead_steps]
    assert noise_rad or settled == []


def test_at_the_border_both_readings_are_told_and_nobody_is_warned() -> None:
    seen = [one for _, one in closed_loop(1.0, steps=200, target_rad=0.02)]
    assert seen
    assert not any(one.growing or one.grown for one in seen)
    finding = oscillation_finding(seen[-1], motion=None, override=1.0, yields=False)
    assert finding.severity is Severity.NOTE
    assert finding.sentence == (
        "A1 swings at 3.33 Hz by 0.57 degrees and neither grows nor decays: either the application means it to, or its "
        "loop has a gain of about 1 and is at the border of stability (feedback effect, manual 7.11); positions alone "
        "do not tell the two apart"
    )


def test_what_grew_into_a_limit_is_still_a_fault_of_the_loop() -> None:
    seen = [one for _, one in closed_loop(1.3, steps=300, limit_rad=0.04)]
    last = seen[-1]
    assert (seen[0].growing, last.growing, last.grown) == (True, False, True)
    finding = oscillation_finding(last, with_it=(1, 3), motion=None, override=1.0, yields=True)
    assert finding.evidence[-1] == "A2, A4 swing with it"
    assert (finding.severity, finding.whose) == (Severity.WARNING, Whose.APPLICATION)
    assert "and grew before: the application's loop is unstable" in finding.sentence
    assert any("more compliant" in remedy for remedy in finding.remedies)


def test_a_gain_that_is_raised_while_the_loop_runs_is_found_later() -> None:
    gains = [0.5] * 200 + [1.4] * 100
    seen = closed_loop(gains, steps=300, noise_rad=1e-4, target_rad=0.02)
    assert seen
    assert 200 < min(step for step, one in seen if one.growing) < 260


@pytest.mark.parametrize("period_ms", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("frequency_hz", [0.25, 1.0, 3.0])
def test_a_sine_on_purpose_is_no_warning(frequency_hz: float, period_ms: float) -> None:
    seen = commanded_on_purpose(sine(0.05, frequency_hz), seconds=10.0 / frequency_hz**0.5, period_ms=period_ms)
    assert not any(one.growing or one.grown for one in seen)
    # Where the arm is less than 30 degrees of the period behind, it is not even a note.
    assert frequency_hz > 1.0 or seen == []


def chirp(at_s: float) -> float:
    return 0.03 * math.sin(2.0 * math.pi * (0.2 + 0.15 * at_s) * at_s)


def steps_to_and_fro(at_s: float) -> float:
    return 0.1 * (int(at_s / 0.3) % 2)


def longer_strokes(at_s: float) -> float:
    stroke = int(at_s / 0.3)
    return 0.005 * (stroke + 1) * (-1.0 if stroke % 2 else 1.0)


def ramp_with_ripple(at_s: float) -> float:
    return 0.2 * at_s + 0.002 * math.sin(30.0 * at_s)


@pytest.mark.parametrize("path", [chirp, steps_to_and_fro, longer_strokes, ramp_with_ripple])
def test_other_motions_on_purpose_are_no_warning(path) -> None:  # type: ignore[no-untyped-def]
    seen = commanded_on_purpose(path, seconds=15.0, period_ms=10.0)
    assert not any(one.growing or one.grown for one in seen)


@pytest.mark.parametrize("path", files(), ids=lambda path: path.stem)
def test_the_recorded_clients_are_no_finding(path: Path) -> None:
    codec, detector = FriCodec(release_of(path)), FeedbackOscillation()
    seen: list[Oscillation] = []
    commands, now_ns, measured, active = 0, 0, None, False
    for from_controller, payload in datagrams(path):
        if from_controller:
            message = codec.decode_monitoring(payload)
            assert message.connection is not None
            assert message.monitor is not None
            active = message.connection.session_state == SessionState.COMMANDING_ACTIVE
            now_ns += (message.connection.send_period_ms or 1) * 1_000_000
            measured = message.monitor.measured_position
        elif active and (command := codec.decode_command(payload).command) and command.position:
            commands += 1
            seen += detector.take(command.position, measured, now_ns=now_ns)  # type: ignore[arg-type]
    assert seen == []
    # Recorded I/O clients and Cartesian clients send no positions.
    assert commands > 100 or "-io-" in path.stem or "cartesian" in path.stem


def test_memory_is_bounded() -> None:
    points = TurningPoints()
    for place in range(10_000):
        points.take((place,), (on_axis((-1.0) ** place),), 0)
    assert len(points.turns) == REMEMBERED
    assert len(points.swings) == REMEMBERED - 1
    detector = FeedbackOscillation()
    for step in range(2000):
        detector.take(on_axis(0.01 * step), on_axis(0.0), now_ns=step * SAMPLE_NS)
        assert len(detector._batch) < MOST_ROWS  # what is to be bounded


def test_a_long_silence_ends_what_was_seen() -> None:
    points = FeedbackOscillation()
    points.take(on_axis(0.0), on_axis(0.0), now_ns=0)
    points.take(on_axis(1.0), on_axis(0.0), now_ns=3_000_000_000)
    assert len(points._batch) == 1  # nothing else shows it
