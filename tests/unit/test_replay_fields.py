"""Differences of messages in the words of their fields."""

import pytest

from hil.cli.replay import _show
from hil.replay.fields import FieldDifference, differences
from hil.replay.result import Moment, ReplayResult
from hil.values.arm import Contact
from hil.values.fri_messages import (
    CommandData,
    CommandMessage,
    ConnectionInfo,
    IpoData,
    MonitorData,
    MonitoringMessage,
    RobotInfo,
    TimeStamp,
    Transformation,
)
from hil.values.link import Address
from hil.values.servo import State
from tests.unit.test_servo_codec import SNAPSHOT

SEVEN = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
MONITOR = MonitorData(SEVEN, SEVEN, SEVEN, SEVEN, SEVEN, (1.0,) * 6, (), None, None, TimeStamp(1, 2))
MESSAGE = MonitoringMessage(
    7,
    3,
    RobotInfo(7, 0, (2,) * 7, 2, 0),
    MONITOR,
    ConnectionInfo(4, 3, 1, 1),
    IpoData(SEVEN, Transformation("Flange", (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)), None, 1, 1, 1.0),
)


def changed(values: tuple[float, ...], place: int, by: float) -> tuple[float, ...]:
    return (*values[:place], values[place] + by, *values[place + 1 :])


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (MESSAGE, []),
        (
            MESSAGE._replace(monitor=MONITOR._replace(commanded_position=changed(SEVEN, 2, 0.25e-3))),
            ["A3 commanded +0.25 mrad (recorded 0.2, emulator 0.20025)"],
        ),
        (
            MESSAGE._replace(monitor=MONITOR._replace(measured_torque=changed(SEVEN, 0, -1.5))),
            ["A1 measured torque -1.5 Nm (recorded 0.0, emulator -1.5)"],
        ),
        (
            MESSAGE._replace(monitor=MONITOR._replace(external_force=changed((1.0,) * 6, 5, 0.25))),
            ["Mz external force +0.25 Nm (recorded 1.0, emulator 1.25)"],
        ),
        (MESSAGE._replace(sequence_counter=8), ["sequence counter: recorded 7, emulator 8"]),
        (
            MESSAGE._replace(connection=ConnectionInfo(2, 3, 1, 1)),
            ["session state: recorded 4, emulator 2"],
        ),
        (MESSAGE._replace(ipo=None), [f"ipo: recorded {str(MESSAGE.ipo)[:60]}..., emulator nothing"]),
        (
            MESSAGE._replace(robot=RobotInfo(7, 0, (2, 2, 0, 2, 2, 2, 2), 2, 0)),
            ["A3 drive state: recorded 2, emulator 0"],
        ),
    ],
)
def test_a_difference_is_told_in_words(other: MonitoringMessage, told: list[str]) -> None:
    assert [str(one) for one in differences(MESSAGE, other)] == told


def test_every_field_that_differs_is_told() -> None:
    other = MESSAGE._replace(
        sequence_counter=9, monitor=MONITOR._replace(measured_position=tuple(value + 1 for value in SEVEN))
    )
    assert [one.name for one in differences(MESSAGE, other)] == [
        "sequence counter",
        *(f"A{axis} measured" for axis in range(1, 8)),
    ]


def test_the_pose_has_millimetres() -> None:
    assert MESSAGE.ipo is not None
    assert MESSAGE.ipo.pose is not None
    pose = MESSAGE.ipo.pose._replace(values=(1.0, 2.5, 3.0, 1.0, 0.0, 0.0, 0.0))
    [found] = differences(MESSAGE, MESSAGE._replace(ipo=MESSAGE.ipo._replace(pose=pose)))
    assert str(found) == "ty interpolator pose +0.5 mm (recorded 2.0, emulator 2.5)"


def test_speed_and_contacts_of_a_state_packet_have_their_units() -> None:
    touched = Contact((0.5, 0.0, 1.0), (0.0, 0.0, -20.0))
    one = State(1, 2, 3, 4, SNAPSHOT._replace(contacts=(touched,)))
    moved = touched._replace(point_m=(0.5, 0.25, 1.0), force_n=(0.0, 0.0, -20.5))
    other = State(1, 2, 3, 4, SNAPSHOT._replace(flange_speed_mm_s=126.0, contacts=(moved,)))
    assert [str(found) for found in differences(one, other)] == [
        "flange speed +0.5 mm/s (recorded 125.5, emulator 126.0)",
        "y contacts 0 point +0.25 m (recorded 0.0, emulator 0.25)",
        "z contacts 0 force -0.5 N (recorded -20.0, emulator -20.5)",
    ]


def test_a_vector_of_another_length_is_one_difference() -> None:
    one, other = (CommandMessage(1, 1, CommandData(position=vector)) for vector in (SEVEN, SEVEN[:6]))
    [found] = differences(one, other)
    assert found.name == "commanded"
    assert found.change is None


def test_messages_of_two_kinds_are_one_difference() -> None:
    [found] = differences(MESSAGE, CommandMessage(1, 1))
    assert str(found) == "message: recorded MonitoringMessage, emulator CommandMessage"


def test_a_table_names_session_states_and_tells_whole_parts_in_a_word(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    result = ReplayResult("run.pcapng", own=False, compared=2, identical=1)
    found = [
        FieldDifference("session state", "", 4, 2),
        FieldDifference("ipo", "", Address("a part of a message", 1), None),
        FieldDifference("A3 commanded", "rad", 0.5, 0.75),
    ]
    result.differ(Moment("arm", 1.0, 1000, 2001), found)
    _show(result, drawn=None, update=False)
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("│")]
    assert [[cell.strip() for cell in row.split("│")[4:7]] for row in rows] == [
        ["COMMANDING_ACTIVE", "MONITORING_READY", ""],
        ["something", "nothing", ""],
        ["0.5", "0.75", "0.25 rad"],
    ]
