"""A real arm beside an emulated one: here the real one is our own controller's, so what must differ is known."""

import json
from functools import cache, partial
from pathlib import Path

import pytest

from backends.mujoco import MujocoBackend
from hil.core.settings import FriSettings
from hil.values.arm import Push
from hil.values.errors import ConfigurationError
from hil.values.fri import DriveState, Release, SessionState
from hil.values.fri_messages import MonitoringMessage
from tests.support.cli import cli
from tests.support.virtual import MS, PEER, Bench
from tools.shadow.comparison import MOST_BRIDGED, ShadowComparison
from tools.shadow.drawing import check_picture, draw

ROBOT = "lbr-iiwa-14-r820"
QUIET = partial(MujocoBackend, torque_noise=False)
CAPTURE = Path(__file__).parents[1] / "data" / "fri-1.15-joint-position-5ms.pcapng"


@cache
def recorded(release: Release = Release.V1_15, *, push: bool = False, seconds: float = 0.6) -> list[MonitoringMessage]:
    """What a controller says whose client moves A4, and whose arm is pushed in the middle of it."""
    bench = Bench(release, backend=QUIET, fri=FriSettings(peer=PEER, quality_rise_ms=20))
    bench.client.frequency_hz, bench.client.amplitude_rad = 1.0, 0.05
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.keep_messages = True
    bench.run(seconds / 2)
    if push:
        assert not bench.controller.operate(Push(4, (0.0, 40.0, 0.0), (0.0, 0.0, 0.0), 0.2), now_ns=bench.now_ns)
    bench.run(seconds / 2)
    return bench.monitoring


def compare(messages: list[MonitoringMessage], release: Release = Release.V1_15) -> ShadowComparison:
    """Let the comparison take the messages, one a millisecond."""
    comparison = ShadowComparison(release=release, robot=ROBOT)
    for place, message in enumerate(messages):
        comparison.take(message, place * MS)
    comparison.close()
    return comparison


def test_an_arm_that_is_the_emulated_one_does_not_differ() -> None:
    comparison = compare(recorded())
    assert comparison.compared == 300
    assert max(one.rms for one in comparison.differences["position"]) < 0.01, "mrad"
    assert max(one.rms for one in comparison.differences["measured torque"]) < 0.5, "Nm"
    assert max(one.rms for one in comparison.differences["external torque"]) < 0.3, "Nm"
    assert not comparison.notes()


def test_what_pushes_the_real_arm_shows_up_with_its_axis_and_time() -> None:
    comparison = compare(recorded(push=True))
    external = comparison.differences["external torque"]
    assert max(external, key=lambda one: abs(one.worst)) is external[0]
    assert abs(external[0].worst) > 5.0
    assert 0.35 < external[0].worst_at_s < 0.52


def test_2_x_is_led_by_where_the_arm_is_measured_and_says_so() -> None:
    comparison = compare(recorded(Release.V2_5), Release.V2_5)
    assert comparison.compared == 300
    assert max(one.rms for one in comparison.differences["measured torque"]) < 2.0
    [note] = comparison.notes()
    assert "only torques tell something" in note


def test_missing_messages_are_bridged_and_old_ones_count_for_nothing() -> None:
    messages = recorded()
    kept = [message for place, message in enumerate(messages) if place % 10 not in {3, 4}]
    comparison = compare([message for message in kept for _ in range(2)])
    assert comparison.counts["missing"] == len(messages) - len(kept)
    assert comparison.counts["old"] == len(kept)
    assert comparison.counts["begun anew"] == 1
    assert max(one.rms for one in comparison.differences["position"]) < 0.2, "mrad"


def test_after_a_long_gap_it_begins_anew() -> None:
    messages = recorded()
    comparison = compare(messages[:100] + messages[101 + MOST_BRIDGED :])
    assert comparison.counts["begun anew"] == 2


def test_an_arm_whose_drives_do_not_hold_it_is_not_compared() -> None:
    messages = recorded()
    robot = messages[0].robot
    assert robot is not None
    dropped = robot._replace(drive_states=(DriveState.OFF,) * 7)
    comparison = compare([message._replace(robot=dropped) for message in messages])
    assert comparison.compared == 0
    assert comparison.counts["not held"] == len(messages)
    assert "nothing was compared" in comparison.notes()[0]


def test_what_is_no_message_of_the_release_is_counted() -> None:
    messages = recorded(seconds=0.02)
    assert compare(messages, Release.V2_5).counts["malformed"] == len(messages)
    monitor = messages[0].monitor
    assert monitor is not None
    wild = messages[0]._replace(monitor=monitor._replace(commanded_position=(1e6,) * 7))
    assert compare([wild]).counts["malformed"] == 1


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    file = tmp_path / "shadow.svg"
    draw(compare(recorded()), file, title="test")
    assert "external torque, Nm" in file.read_text() or file.stat().st_size > 10_000
    with pytest.raises(ConfigurationError, match="valid endings"):
        check_picture(tmp_path / "shadow.txt")


def test_a_capture_on_the_cli(tmp_path: Path) -> None:
    result = tmp_path / "shadow.json"
    ended = cli("shadow", CAPTURE, "--json", result)
    assert ended.code == 0, ended.err
    assert "emulated minus real, 286 messages compared" in ended.out
    found = json.loads(result.read_text())
    assert found["led_by"] == "commanded position"
    assert found["differences"]["position"]["A4"]["rms"] < 0.1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "give a capture, or --bind"),
        ((CAPTURE, "--bind", "127.0.0.1"), "give a capture, or --bind"),
        ((CAPTURE, "--seconds", "1"), "a capture is read to its end"),
        (("nothing.pcapng",), "nothing.pcapng"),
        ((CAPTURE, "--robot", "x"), "unknown robot 'x'"),
    ],
)
def test_what_cannot_be_is_one_sentence(arguments: tuple[object, ...], told: str) -> None:
    ended = cli("shadow", *arguments)
    assert ended.code == 2
    assert told in ended.err
    assert ended.err.count("\n") == 1
