"""An application that is too slow for its motion, through the real client and ``hil run``: told live and at the end."""

import json
from pathlib import Path

import pytest

from hil.client.servo import PTP, ServoClient, SmartServo
from tests.support.servo_process import servo_controller

CYCLE_NS = 40_000_000


def test_a_seconds_hand_is_told_and_the_books_are_in_the_status(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    with servo_controller("--status-json", status) as controller, ServoClient(controller.address, name="slow") as robot:
        start = robot.read_state().commanded_position
        robot.move(PTP(start))
        motion = SmartServo().override_joint_acceleration(20).set_joint_jerk(1500)
        robot.move_async(motion)
        runtime = motion.get_runtime()
        runtime.update_with_realtime_system()
        for number in range(1, 26):
            began_ns = runtime.get_time_stamp_of_update()
            runtime.set_destination((start[0] + 1e-4 * number, *start[1:]))
            while runtime.get_time_stamp_of_update() < began_ns + CYCLE_NS:
                runtime.update_with_realtime_system()
        seen = runtime.set_point_accounting
        runtime.set_detailed_output(3)
        assert f"set points: {seen}" in str(runtime)
        runtime.stop_motion()
    assert (seen.sent, seen.received, seen.waiting) == (25, 25, 0)
    assert seen.age_ms is not None
    assert 20.0 < seen.age_ms < 40.0
    assert controller.ended is not None
    printed = controller.ended.out + controller.ended.err
    lines = [line for line in printed.splitlines() if "seconds hand effect" in line]
    assert len(lines) >= 2, "live, and in the summary"
    assert "(SmartServo): the arm stood still before" in lines[0]
    assert "1. give a destination more time: set_minimum_trajectory_execution_time(0.0" in printed
    assert "2. or go slower: set_joint_velocity_rel(" in printed
    assert "3. or set destinations " in printed
    arm = json.loads(status.read_text())["robots"]["arm"]
    [shown] = arm["servo"]["motions"]
    assert (shown["sent"], shown["received"], shown["refused"]) == (25, 25, 0)
    assert shown["executed"] + shown["superseded"] + shown["waiting"] == 25
    assert shown["standstills"] >= 5
    [finding] = [one for one in arm["findings"] if one["kind"] == "seconds-hand"]
    assert finding["whose"] == "application"
    measured_s = finding["figures"]["application_cycle_mean_ms"] / 1e3
    assert 0.038 < measured_s < 0.2
    assert finding["figures"]["minimum_execution_time_low_s"] == pytest.approx(1.5 * measured_s, abs=0.0011)
