"""--kst-strict: what a published server does, its faults included (kst-wire 3, 7 and 8)."""

import pytest

from hil.kst.jobs import ImpedanceServo, JointMotion, LineMotion, Outcome, TorqueRange
from hil.kst.original import STALL_NS, OriginalSession
from hil.kst.phases import Phase
from hil.values.kst import KstSettings
from hil.values.pose import NOWHERE
from tests.support.kst_session import BENT, DATA, MS, Bench, Transcript
from transport.kst import DONE, NAK, Problem

STRICT = KstSettings((-2.9,) * 7, (2.9,) * 7, strict=True, nagle=True)
TARGET = "jp_0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_"
EXTERNAL = b"0.01_-0.02_3.0E-5_0.5_-0.25_0.125_0.0625_\n"


def original() -> Bench:
    return Bench(settings=STRICT)


def moving(start: str = "doPTPinJS") -> Bench:
    bench = original()
    for line in ("jRelVel_0.1_", TARGET, start):
        assert bench.say(line) == [DONE]
    return bench


def session(bench: Bench) -> OriginalSession:
    assert isinstance(bench.session, OriginalSession)
    return bench.session


@pytest.mark.parametrize("name", ["getters", "ptp-motion", "direct-servo-joints", "impedance-with-feedback"])
def test_valid_programs_get_the_same_bytes(name: str) -> None:
    Transcript(original()).replay((DATA / f"{name}.txt").read_text(encoding="ascii"))


@pytest.mark.parametrize(
    "line",
    [
        "foo",
        "Eef_pos_",
        "getPin5",
        "DcSeCarW_1_2_3_4_5_6_",
        "startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_",
        "x" * 3000,
        "\x00\x01",
    ],
)
def test_what_it_does_not_know_is_met_with_silence(line: str) -> None:
    bench = original()
    assert bench.say(line) == []
    assert sum(bench.session.log.refused.values()) == 1
    assert bench.say("blueOn") == [DONE]


def test_there_is_no_gap_between_the_acknowledgements() -> None:
    assert moving().end() == [DONE]


def test_a_command_is_lost_while_it_moves() -> None:
    bench = moving()
    assert bench.say("Eef_pos") == []
    assert bench.say("getJointsPositions") != []
    assert bench.end() == [DONE]
    assert bench.session.log.refused == {Problem.BUSY: 1}


def test_the_last_command_during_a_conditional_motion_is_done_after_it() -> None:
    bench = moving("doPTP!inJS_0_-100_100")
    assert bench.say("jRelVel_0.2_") == []
    assert bench.say("Torques_ext_J") == []
    assert bench.end() == [DONE, EXTERNAL]


def test_of_two_commands_in_one_segment_the_first_is_overwritten() -> None:
    bench = original()
    assert bench.say("Torques_ext_J", "Torques_ext_J") == [EXTERNAL]
    assert bench.say("getPin3", "getPin3") == [b"1\n\n"] * 2


@pytest.mark.parametrize("line", ["jp_0_x_0_0_0_0_0_", "jf_nan_0_0_0_0_0_0_", "cArtixanPosition_a_b_c_"])
def test_a_wrong_number_kills_the_reader(line: str) -> None:
    bench = original()
    assert bench.say(line) == []
    assert session(bench).deaf
    assert bench.say("blueOn", "end") == []
    assert not bench.session.over


def test_a_wrong_number_in_a_streamed_set_point_ends_the_mode_silently() -> None:
    bench = original()
    bench.say("stDcEEf_")
    assert bench.say("DcSeCarExT_7_x_0_0_0_0_") == [EXTERNAL]
    assert bench.arm.stops == 1
    assert bench.session.registers.servo_pose is not None
    assert bench.session.registers.servo_pose[0] == 7.0
    bench.end()
    assert bench.session.phase is Phase.IDLE


def test_a_value_too_many_stalls_for_seconds_and_ends_the_mode() -> None:
    bench = original()
    bench.say("stDcEEf_")
    assert bench.say("DcSeCarExT_1_2_3_4_5_6_7_") == []
    assert bench.say("blueOn") == []
    assert bench.session.due_ns == STALL_NS
    assert bench.wait(STALL_NS / MS - 1) == []
    assert bench.wait(1) == [EXTERNAL, DONE]
    assert bench.arm.stops == 1


def test_fewer_values_overwrite_a_part_and_more_are_ignored() -> None:
    bench = original()
    assert bench.say(TARGET) == [DONE]
    assert bench.say("jp_0.5_") == [DONE]
    assert bench.session.registers.joints_rad == (0.5, *BENT[1:])
    assert bench.say("jp_1_2_3_4_5_6_7_8_9_") == [DONE]
    assert bench.session.registers.joints_rad == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)


def test_an_error_forgets_the_tool() -> None:
    bench = original()
    for line, reply in (("TFtrans_50_25_0_0_0_0", DONE), ("jRelVel_x_", NAK)):
        assert bench.say(line) == [reply]
    assert bench.session.tcp_in_flange == NOWHERE


def test_a_tool_of_too_few_values_ends_the_server() -> None:
    bench = original()
    assert bench.say("TFtrans_1_2_3") == [NAK]
    assert bench.session.over
    bench = original()
    assert bench.say("TFtrans_1_2_3_4_5_6_7") == [NAK]
    assert not bench.session.over


def test_impedance_takes_missing_values_for_zero_and_forgets_the_first_axis() -> None:
    bench = original()
    assert bench.say("jp_0.5_0_0_0_0_0_0_") == [DONE]
    assert bench.say("startSmartImpedneceJoints_1.0_") == [DONE]
    assert bench.arm.begun == [ImpedanceServo(1.0, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0)]
    assert bench.session.registers.joints_rad == (0.5, *BENT[1:])


def test_a_start_while_a_mode_runs_is_lost() -> None:
    bench = original()
    bench.say("startDirectServoJoints")
    assert bench.say("stDcEEf_") == []
    assert bench.say("stopDirectServoJoints") == [DONE]
    assert bench.say("doPTPinJS") == []
    bench.end(Outcome.DONE)
    assert len(bench.arm.begun) == 1


def test_a_conditional_circle_is_a_joint_motion_and_a_relative_line_an_absolute_one() -> None:
    bench = moving("doPTP!CSCircle1_0_-100_100")
    assert bench.arm.begun == [JointMotion(BENT, 0.1, (TorqueRange(0, -100.0, 100.0),), conditional=True)]
    bench.end()
    for line in ("cArtixanPosition_1_2_3_0_0_0_", "doPTP!inCSRelBase_0_-1_1"):
        assert bench.say(line) == [DONE]
    assert isinstance(bench.arm.begun[-1], LineMotion)


def test_a_pose_that_took_infinity_is_a_motion_that_is_rejected_and_the_session_lives() -> None:
    bench = original()
    assert bench.say("jRelVel_10") == [DONE]
    assert bench.say("cArtixanPosition_0_0_0_Infinity_0_0") == [DONE]
    assert b"".join(bench.say("doPTPinCS")) == DONE + NAK
    assert bench.say("getPin3") == [b"1\n\n"]
    assert bench.arm.begun == []
