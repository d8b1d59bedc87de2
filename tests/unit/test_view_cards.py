"""What the pad in the page shows: figures with their limits, and no word of a peer that a browser would obey."""

import re
from html import unescape
from typing import Any, cast

import pytest

from backends.robots import load_description
from hil.client.pad import RobotState
from hil.values.fri import ControlMode, OperationMode, SafetyState
from hil.values.operator import OperatorView, ProgramState
from hil.values.pose import Pose
from hil.values.servo import Snapshot
from tools.view.browser import cards
from tools.view.connection import Row
from tools.view.drawing import ArmNow
from tools.view.watch import Message

EVIL = "<img src=x onerror=alert(1)>"
LIMITS = load_description("lbr-iiwa-14-r820").limits
VIEW = OperatorView(OperationMode.T1, ProgramState.RUNNING, True, 50.0, SafetyState.NORMAL_OPERATION, "", False)


def snapshot(**other: Any) -> Snapshot:
    still = (0.0,) * 7
    whole = Snapshot(
        now_ns=0,
        cycle=0,
        operator=VIEW,
        measured_position=still,
        commanded_position=still,
        measured_torque=still,
        external_torque=still,
        flange_in_base=Pose.from_abc_deg((0.5, -0.1, 0.8), 10.0, 20.0, 30.0),
        control_mode=ControlMode.POSITION,
        external_torque_variance=still,
        flange_force=still[:6],
        flange_force_variance=still[:6],
        commander="",
        motions=(),
    )
    changed: Snapshot = whole._replace(**other)
    return changed


def pad(**other: object) -> RobotState:
    margin = {"used": 0.8, "at_s": 1.0, "axis": None}
    state = {
        "session": {"state": "COMMANDING_ACTIVE", "quality": "GOOD"},
        "margins": {"T1, commanded": margin, "T1, measured": {**margin, "used": 0.75}},
        "io": {},
    }
    return cast("RobotState", {**state, **other})


def words(card: str) -> str:
    """Return what a person reads."""
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", card)).split())


def test_the_status_says_mode_program_switch_override_session_and_quality() -> None:
    told = words(cards.status_card("arm", ArmNow(snapshot()), pad()))
    for word in ("arm", "T1", "RUNNING", "enabled", "50 %", "COMMANDING ACTIVE", "GOOD"):
        assert word in told


def test_a_lost_robot_says_why() -> None:
    assert "LOST arm: gone" in words(cards.status_card("arm", ArmNow(snapshot(), "gone"), None))


def test_the_status_is_as_high_with_few_words_as_with_many() -> None:
    stopped = VIEW._replace(reason="the arm is stopped: " + 200 * "x")
    heights = {
        re.findall(r"height:([\d.]+em)", cards.status_card("arm", now, pad()))[0]
        for now in (ArmNow(snapshot()), ArmNow(snapshot(operator=stopped)), ArmNow(None), ArmNow(None, "lost"))
    }
    assert len(heights) == 1


def test_no_text_of_a_peer_is_obeyed() -> None:
    view = VIEW._replace(reason=EVIL)
    shown = ArmNow(snapshot(operator=view, commander=EVIL))
    evil_pad = pad(
        session={"state": EVIL, "quality": EVIL},
        io={EVIL: {"type": "boolean", "direction": EVIL, "value": True, "fri": True}},
    )
    for card in (
        cards.status_card(EVIL, shown, evil_pad),
        cards.status_card(EVIL, ArmNow(None, EVIL), None),
        cards.messages_card([Message(EVIL, 1.0, EVIL)]),
        cards.signals_card(evil_pad),
        cards.rows_card(EVIL, EVIL, [Row(EVIL, EVIL, EVIL, EVIL)]),
        cards.pose_card(EVIL, snapshot().flange_in_base),
        cards.note(EVIL),
    ):
        assert "<img" not in card
        assert "&lt;img" in card


def test_axes_are_shown_between_their_ends() -> None:
    card = cards.axes_card(snapshot(measured_position=(0.0, LIMITS.position_max_rad[1], 0.5, 0, 0, 0, -0.0)), LIMITS)
    assert "A2" in words(card)
    assert "120.00°" in words(card)
    assert "28.65°" in words(card)
    assert "-0.00" not in words(card)
    assert "left:calc(50.0% - 3px)" in card
    assert "left:calc(100.0% - 3px)" in card


def test_a_position_is_shown_in_mm_and_degrees() -> None:
    told = words(cards.pose_card("flange", snapshot().flange_in_base))
    assert told == "flange X 500.0 mm Y -100.0 mm Z 800.0 mm A 10.00 ° B 20.00 ° C 30.00 °"


@pytest.mark.parametrize(("speed", "width"), [(0.0, "0.0%"), (125.0, "50.0%"), (400.0, "100.0%")])
def test_the_gauge_of_t1(speed: float, width: str) -> None:
    card = cards.speed_card(snapshot(flange_speed_mm_s=speed), pad())
    assert f"width:{width}" in card
    assert f"flange {speed:.0f} mm/s, T1: 250 mm/s, margin so far 20%" in words(card)
    assert "margin" not in words(cards.speed_card(snapshot(), None))


def test_messages_are_shown_newest_first() -> None:
    told = words(
        cards.messages_card([Message("arm", 1.0, "first"), Message("arm", 3.0, "last"), Message("arm", 2.0, "then")])
    )
    assert told == "3.00 s arm last 2.00 s arm then 1.00 s arm first"


def test_a_lost_row_is_red() -> None:
    card = cards.rows_card("live", "", [Row("a", "m", "d", ""), Row("b", "m", "", "gone")])
    assert words(card) == "live robot shown by connection a d connected b - gone"
    assert card.count("color:#e03131") == 1
