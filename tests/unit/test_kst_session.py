"""KST sessions, bytes in and bytes out: the transcripts of kst-wire 10, and all that published servers do wrong."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.kst.jobs import (
    CartesianServo,
    CircleMotion,
    Ended,
    ImpedanceServo,
    Job,
    JointMotion,
    JointServo,
    LineMotion,
    Outcome,
    RelativeLine,
    TorqueRange,
    VelocityServo,
)
from hil.kst.log import TOLD_MOST
from hil.kst.phases import PHASES, Phase
from hil.kst.session import OPEN_LINE_NS
from hil.values.kst import MOTION_GAP_NS, KstSettings
from hil.values.pose import NOWHERE, Pose
from tests.support.kst_session import BENT, DATA, MS, SETTINGS, STATES, Bench, Transcript
from transport.kst import COMMANDS, DONE, INTERRUPTED, NAK, Feedback, Problem

TRANSCRIPTS = sorted(DATA.glob("*.txt"))
TARGET = "jp_0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_"
GAP_MS = MOTION_GAP_NS / MS


def moving() -> Bench:
    """Return a session in a motion that has just begun."""
    bench = Bench()
    assert bench.say("jRelVel_0.1_", TARGET, "doPTPinJS") == [DONE] * 3
    return bench


def serving(start: str = "startDirectServoJoints") -> Bench:
    """Return a session in a real-time mode."""
    bench = Bench()
    assert bench.say(start) == [DONE]
    return bench


@pytest.mark.parametrize("file", TRANSCRIPTS, ids=lambda file: file.stem)
def test_transcripts_replay_byte_for_byte(file: Path) -> None:
    compared = Transcript(Bench()).replay(file.read_text(encoding="ascii"))
    assert compared > 100


def test_there_is_a_transcript_of_every_session_that_was_published() -> None:
    assert len(TRANSCRIPTS) == 8


def test_the_two_acknowledgements_of_a_motion_are_kept_apart_in_time() -> None:
    bench = moving()
    assert bench.end() == []
    assert bench.wait(GAP_MS - 1) == []
    assert bench.session.due_ns == MOTION_GAP_NS
    assert bench.wait(1) == [DONE]
    assert not bench.session.busy


def test_the_second_one_waits_until_the_first_one_was_acknowledged_by_tcp() -> None:
    bench = moving()
    bench.session.ended(Ended(Outcome.DONE), now_ns=bench.now_ns)
    later_ns = 10 * MOTION_GAP_NS
    assert bench.session.replies(now_ns=later_ns, all_acknowledged=False) == []
    assert bench.session.replies(now_ns=later_ns, all_acknowledged=True) == [DONE]


@pytest.mark.parametrize(("outcome", "reply"), [("done", DONE), ("failed", NAK), ("interrupted", INTERRUPTED)])
def test_how_a_motion_ended_is_the_second_reply(outcome: str, reply: bytes) -> None:
    bench = moving()
    bench.wait(500)
    assert bench.end(Outcome(outcome), "because") == [reply]
    assert "because" in bench.told()


def test_queries_and_registers_are_served_while_it_moves() -> None:
    bench = moving()
    assert bench.say("getJointsPositions") == [b"0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_\n"]
    assert bench.say("Torques_m_J") == [b"0.1_-61.2_0.0_33.25_1.0E-4_-0.5_0.01_\n"]
    assert bench.say("jRelVel_0.2_", "stopDirectServoJoints") == [DONE, DONE]
    assert bench.session.phase is Phase.MOTION
    assert bench.arm.stops == 0


def test_a_start_while_it_moves_is_refused_and_the_motion_goes_on() -> None:
    bench = moving()
    assert bench.say("doPTPinJS") == [NAK]
    assert bench.say("TFtrans_1_2_3_0_0_0") == [NAK]
    assert bench.session.log.refused[Problem.BUSY] == 2
    assert "the arm is at something else (motion)" in bench.told()
    bench.wait(100)
    assert bench.end() == [DONE]
    assert len(bench.arm.begun) == 1


def test_the_arm_is_free_for_the_next_motion_before_the_last_reply_goes_out() -> None:
    bench = moving()
    bench.wait(100)
    bench.end()
    assert bench.say("doPTPinJS") == [DONE]
    assert len(bench.arm.begun) == 2


def test_a_start_that_comes_while_a_mode_comes_to_rest_waits_for_that() -> None:
    bench = serving()
    assert bench.say("stopDirectServoJoints") == [DONE]
    assert bench.say("jRelVel_0.1_", TARGET, "doPTPinJS") == [DONE, DONE]
    assert [type(job) for job in bench.arm.begun] == [JointServo]
    assert bench.end() == [DONE]
    assert isinstance(bench.arm.begun[-1], JointMotion)


def test_a_stop_holds_for_what_waits_too() -> None:
    bench = serving()
    assert bench.say("stopDirectServoJoints", "startDirectServoJoints", "stopDirectServoJoints") == [DONE, NAK, DONE]
    assert "was stopped before it could begin" in bench.told()
    bench.end()
    assert not bench.session.busy
    assert len(bench.arm.begun) == 1


def test_what_motions_are_asked_for() -> None:
    bench = Bench()

    def run(*lines: str) -> Job:
        assert bench.say(*lines) == [DONE] * len(lines)
        bench.wait(100)
        assert bench.end() == [DONE]
        return bench.arm.begun[-1]

    assert run("jRelVel_0.25_", TARGET, "doPTPinJS") == JointMotion(BENT, 0.25)
    target = Pose(0.1, 0.2, 0.3)
    assert run("jRelVel_30_", "cArtixanPosition_100_200_300_0_0_0_", "doPTPinCS") == LineMotion(target, 30.0)
    tcp = Pose(0.05, 0.025, 0.0)
    relative = RelativeLine((0.1, 0.2, 0.3), False, 30.0, tcp)
    assert run("TFtrans_50_25_0_0_0_0", "doPTPinCSRelBase") == relative
    assert run("doPTPinCSRelEEF") == relative._replace(in_tool=True)
    circle = CircleMotion(Pose(0.001, 0.0, 0.0), Pose(0.002, 0.0, 0.0), 30.0, tcp)
    assert (
        run("cArtixanPositionCirc1_1_0_0_0_0_0_", "cArtixanPositionCirc2_2_0_0_0_0_0_", "doPTPinCSCircle1_") == circle
    )
    conditions = (TorqueRange(1, -20.5, 20.0), TorqueRange(6, 0.0, 1.0))
    conditional = LineMotion(target, 30.0, tcp, conditions, conditional=True)
    assert run("doPTP!inCS_1_-20.5_20_6_0_1_") == conditional


def test_what_real_time_modes_are_asked_for() -> None:
    bench = Bench()
    for start, job in {
        "startDirectServoJoints": JointServo(),
        "stDcEEf_": CartesianServo(NOWHERE),
        "stVelDcJoint_": VelocityServo(),
        "startSmartImpedneceJoints_1.5_10_20_30_900_80_50_": ImpedanceServo(1.5, (10.0, 20.0, 30.0), 900.0, 80.0, 50.0),
    }.items():
        assert bench.say(start) == [DONE]
        assert bench.arm.begun[-1] == job
        assert bench.session.registers.joints_rad == BENT
        assert bench.say("stopDirectServoJoints") == [DONE]
        bench.wait(100)
        bench.end()
        assert not bench.session.busy


def test_a_conditional_motion_without_conditions_moves_nothing() -> None:
    bench = Bench()
    assert bench.say("jRelVel_0.1_", TARGET, "doPTP!inJS_") == [DONE] * 3
    assert bench.wait(GAP_MS) == [DONE]
    assert bench.arm.begun == []


IMPOSSIBLE = {
    "doPTPinJS": "there is no joint target",
    "doPTPinCS": "there is no Cartesian target",
    "doPTPinCSRelBase": "there is no displacement",
    "doPTPinCSCircle1_": "a circle needs both its points",
    "doPTP!inJS_7_0_1": "there is no axis 7",
    "doPTP!inJS_0.5_0_1": "there is no axis 0.5",
    "doPTP!inCS_0_1_0": "the torque range 1..0 Nm is empty",
    "doPTP!inCSRelBase_0_0_1": "a published server takes a conditional relative line for an absolute one",
    "doPTP!CSCircle1_0_0_1": "a published server does a joint motion instead",
}


@pytest.mark.parametrize(("start", "reason"), IMPOSSIBLE.items())
def test_a_motion_that_cannot_be_is_rejected_as_a_controller_does_it(start: str, reason: str) -> None:
    bench = Bench()
    assert bench.say(start) == [DONE]
    assert bench.wait(GAP_MS) == [NAK]
    assert reason in bench.told()
    assert bench.arm.begun == []
    assert bench.session.log.refused == {Problem.NOT_POSSIBLE: 1}
    assert bench.say("Torques_m_J") != []


def test_a_joint_motion_needs_a_relative_speed() -> None:
    bench = Bench()
    assert bench.say(TARGET, "doPTPinJS") == [DONE, DONE]
    assert bench.wait(GAP_MS) == [NAK]
    assert bench.say("jRelVel_30_", "doPTPinJS") == [DONE, DONE]
    assert bench.wait(GAP_MS) == [NAK]
    assert "a relative speed above 0, up to 1; it is 30" in bench.told()


def test_a_target_that_was_refused_is_none() -> None:
    bench = Bench()
    assert bench.say("jRelVel_0.1_", TARGET, "jp_9_0_0_0_0_0_0_") == [DONE, DONE, NAK]
    assert "A1 at 9 rad is outside its range -2.9000..2.9000 rad" in bench.told()
    assert bench.say("doPTPinJS") == [DONE]
    assert bench.wait(GAP_MS) == [NAK]
    assert bench.say("jRelVel_-1_") == [NAK]
    assert bench.session.registers.speed is None


@pytest.mark.parametrize(
    "line",
    [
        "cArtixanPosition_1e308_0_0_0_0_0_",
        "cArtixanPositionCirc1_0_-20000_0_0_0_0_",
        "cArtixanPositionCirc2_0_0_20000_0_0_0_",
        "DcSeCarJP_0_0_1e300_0_0_0_",
        "TFtrans_1e9_0_0_0_0_0",
    ],
)
def test_a_place_no_arm_reaches_is_refused(line: str) -> None:
    bench = Bench()
    assert bench.say(line) == [NAK]
    assert "is beyond the reach of any arm" in bench.told()


def test_a_velocity_an_axis_cannot_have_is_refused_and_the_one_before_stays() -> None:
    bench = Bench(settings=KstSettings((-2.9,) * 7, (2.9,) * 7, (1.0,) * 7))
    assert bench.say("stVelDcJoint_", "velJDC_0.5_0_0_0_0_0_0_", "velJDC_0_0_-1.5_0_0_0_0_") == [DONE, DONE, NAK]
    assert "A3 at -1.5 rad/s is faster than its 1.0000 rad/s" in bench.told()
    assert bench.session.registers.velocity_rad_s[0] == 0.5


def test_a_set_point_that_is_refused_changes_nothing_and_the_mode_goes_on() -> None:
    bench = serving()
    for wrong in ("jp_1_2_", "jp_0_0_x_0_0_0_0_", "jpExT_0_0_NaN_0_0_0_0_", "jpJP_9_0_0_0_0_0_0_"):
        assert bench.say(wrong) == [NAK]
    assert bench.say("jf_0_0_Infinity_0_0_0_0_") == []
    assert bench.session.registers.joints_rad == BENT
    assert bench.session.phase is Phase.SERVO
    assert bench.arm.stops == 0
    assert sum(bench.session.log.refused.values()) == 5
    assert bench.say("jp_0.1_0_0_0_0_0_0_") == [DONE]
    assert bench.session.registers.joints_rad == (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("spec", COMMANDS, ids=lambda spec: spec.token)
def test_every_command_that_has_a_reply_has_one_in_every_state(spec: object) -> None:
    token, values, reply = spec.token, spec.values or 0, spec.reply  # type: ignore[attr-defined]
    line = token.rstrip("_") + "_0.1" * values if values else token
    for make in (Bench, moving, serving):
        bench = make()
        writes = bench.say(line)
        assert len(writes) == (0 if reply is Feedback.NOTHING else 1)


def test_the_outputs_are_kept_and_inputs_are_high() -> None:
    bench = Bench()
    assert bench.say("blueOn", "pin12on", "pin1off", "getPin10") == [DONE, DONE, DONE, b"1\n\n"]
    assert bench.session.outputs == {"blue": True, "pin12": True, "pin1": False}


def test_hand_guiding_is_acknowledged_at_once_and_said_to_be_nothing() -> None:
    bench = Bench()
    assert bench.say("preciseHandGuiding1_-10.0_0.0_0.0_0.05") == [DONE]
    assert "nothing is done" in bench.told()


@pytest.mark.parametrize("line", ["handGuiding_" + "x" * 900, "doPTP!inJS"])
def test_what_a_client_may_cause_as_often_as_it_likes_is_told_seldom_and_in_short(line: str) -> None:
    bench, sentences = Bench(), list[str]()
    assert bench.say("jRelVel_0.1", TARGET) == [DONE, DONE]
    for _ in range(250):
        bench.say(line)
        bench.wait(GAP_MS)
        sentences += bench.told().splitlines()
    assert len(sentences) == 7
    assert max(map(len, sentences)) < 200


@pytest.mark.parametrize("phase", ["moving", "stopping"])
def test_a_target_that_is_refused_while_the_arm_comes_to_rest_leaves_none_either(phase: str) -> None:
    bench = moving() if phase == "moving" else serving()
    if phase == "stopping":
        assert bench.say(TARGET, "stopDirectServoJoints") == [DONE, DONE]
    wrong = ("jp_NaN_0_0_0_0_0_0", "cArtixanPosition_0_0_1e9_0_0_0", "cArtixanPositionCirc1_1", "jRelVel_0")
    assert bench.say(*wrong) == [NAK] * 4
    bench.end()
    bench.wait(GAP_MS)
    begun = len(bench.arm.begun)
    for start in ("doPTPinJS", "doPTPinCSRelBase", "doPTPinCSCircle1"):
        assert bench.say(start) == [DONE]
        assert bench.wait(GAP_MS) == [NAK]
    assert len(bench.arm.begun) == begun


def test_a_line_that_cannot_be_read_leaves_no_target_and_a_stream_without_replies_in_step() -> None:
    for wrong in ("jp_0_0_0_0_0_0_\t0", "jp_" + "0" * 2000):
        bench = Bench()
        assert bench.say("jRelVel_0.1", TARGET, wrong) == [DONE, DONE, NAK]
        assert bench.say("doPTPinJS") == [DONE]
        assert bench.wait(GAP_MS) == [NAK]
        assert bench.arm.begun == []
    assert bench.say("jf_0_0_0_0_0_0_\x00") == []
    assert bench.session.log.refused[Problem.NOT_TEXT] == 1


def test_forces_are_those_at_the_tool_along_its_axes() -> None:
    bench = Bench(state=STATES["straight"])
    _, force, moment = bench.say("TFtrans_0_0_1000_1.5707963267948966_0_0", "Eef_force", "Eef_moment")
    assert _numbers(force) == pytest.approx((-2.25, -1.5, 0.5))
    assert _numbers(moment) == pytest.approx((-1.48, 2.24, -0.03))


def _numbers(reply: bytes) -> list[float]:
    return [float(text) for text in reply.decode().split("_")[:-1]]


def test_the_second_acknowledgement_of_impedance_can_be_left_out() -> None:
    start = "startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_"
    for second, writes in ((True, [DONE]), (False, [])):
        bench = Bench(settings=KstSettings((-2.9,) * 7, (2.9,) * 7, second_acknowledgement=second))
        assert bench.say(start, "stopDirectServoJoints") == [DONE, DONE]
        bench.wait(100)
        assert bench.end() == writes
        assert not bench.session.busy


def test_impedance_that_ends_by_itself_sends_its_second_acknowledgement_at_once() -> None:
    bench = Bench()
    assert bench.say("startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_") == [DONE]
    assert bench.end(Outcome.FAILED, "the load is another") == []
    assert bench.wait(GAP_MS) == [DONE]
    assert "set-points move nothing from now on: the load is another" in bench.told()
    assert bench.say(TARGET) == [DONE]
    assert bench.session.counters["set_points_after_a_failed_mode"] == 1


def test_a_mode_that_failed_leaves_set_points_answered_and_the_arm_free() -> None:
    bench = serving("stDcEEf_")
    assert bench.end(Outcome.FAILED, "target outside") == []
    assert bench.say("DcSeCarJP_1_2_3_0_0_0_") == [b"0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_\n"]
    assert bench.say("stopDirectServoJoints") == [DONE]
    assert bench.arm.stops == 0
    assert not bench.session.busy


def test_a_line_without_an_end_is_told_and_may_still_get_one() -> None:
    bench = Bench()
    assert bench.send(b"getJoints") == []
    assert bench.session.due_ns == OPEN_LINE_NS
    assert bench.wait(1000) == []
    assert "b'getJoints' waits for its line end" in bench.told()
    assert bench.send(b"Positions\n") == [b"0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_\n"]
    assert bench.session.log.refused == {Problem.NO_END: 1}


def test_a_line_without_an_end_is_counted_when_the_client_closes() -> None:
    bench = Bench()
    assert bench.send(b"blueOn\ngetJoints") == [DONE]
    bench.session.closed()
    assert "b'getJoints' had no line end, a LF, when the client closed" in bench.told()
    assert bench.session.log.refused == {Problem.NO_END: 1}
    assert bench.session.due_ns is None


def test_a_line_too_long_and_binary_are_refused_and_the_session_lives() -> None:
    bench = Bench()
    assert bench.send(b"jp_" + b"0" * 5000) == [NAK]
    assert bench.send(b"\n") == []
    assert bench.send(bytes(range(11, 256)) + b"\n") == [NAK] * 2
    assert bench.session.log.refused[Problem.TOO_LONG] == 1
    assert bench.say("blueOn") == [DONE]


def test_refusals_are_told_at_first_and_then_counted() -> None:
    bench = Bench()
    for _ in range(250):
        bench.say("foo")
    assert bench.session.log.refused[Problem.UNKNOWN] == 250
    # The first five, the tenth and the hundredth.
    assert bench.told().count("\n") == 5 + 2 - 1


def test_nothing_is_served_after_the_end() -> None:
    bench = Bench()
    assert bench.say("end", "blueOn") == []
    assert bench.session.over


def test_blank_lines_mean_nothing() -> None:
    assert Bench().send(b"\n\n\r\n\n") == []


@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from([f"{spec.token}_1_0_0_0_0_0_0\n".encode() for spec in COMMANDS]),
            st.sampled_from([f"{spec.token}\n".encode() for spec in COMMANDS]),
            st.sampled_from(list(Outcome)),
            st.integers(0, 3000),
        ),
        max_size=40,
    ),
    st.booleans(),
)
def test_whatever_comes_the_session_neither_raises_nor_grows(story: list[bytes | Outcome | int], strict: bool) -> None:
    bench = Bench(settings=KstSettings((-2.9,) * 7, (2.9,) * 7, strict=strict))
    for step in story:
        if isinstance(step, bytes):
            writes = bench.send(step)
        elif isinstance(step, Outcome):
            jobs_open = bench.session.busy and bench.session._held.__len__() == 0
            writes = bench.end(step) if jobs_open else []
        else:
            writes = bench.wait(step)
        assert all(0 < len(write) <= 1024 for write in writes)
    assert len(bench.session.log.told) <= TOLD_MOST
    assert len(bench.session._waiting) <= 8


def test_the_table_of_phases_leaves_none_without_a_way_back() -> None:
    reachable = {phase for (_, _), phase in PHASES.items()}
    assert reachable == set(Phase)
    for phase in set(Phase) - {Phase.IDLE}:
        assert any(before is phase for before, _ in PHASES)


def test_settings_say_the_gap() -> None:
    assert SETTINGS.motion_gap_ns == MOTION_GAP_NS
    assert KstSettings((), (), strict=True).motion_gap_ns == 0
