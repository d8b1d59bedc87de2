"""Lines, numbers and commands of the KST protocol: kst-wire sections 2 and 4."""

import math
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from transport.kst import (
    COMMANDS,
    DONE,
    INTERRUPTED,
    LINE_MOST_BYTES,
    NAK,
    REPLY_MOST_BYTES,
    Command,
    Feedback,
    LineCutter,
    Problem,
    Refused,
    Request,
    java_double,
    java_text,
    pin_reply,
    read_request,
    values_reply,
)

PRINTED = {
    1e-4: "1.0E-4",
    3e-5: "3.0E-5",
    1e7: "1.0E7",
    1e-3: "0.001",
    -0.0: "-0.0",
    math.nan: "NaN",
    math.inf: "Infinity",
    -math.inf: "-Infinity",
    9.265358979327931e-05: "9.265358979327931E-5",
    # Rounding the exact value to as many digits is another number here.
    2.0**-24: "5.960464477539063E-8",
    1306.0: "1306.0",
    400.01167249652696: "400.01167249652696",
    9999999.999: "9999999.999",
    12345678.9: "1.23456789E7",
    -2.5e-7: "-2.5E-7",
    5e-324: "4.9E-324",
    1e23: "1.0E23",
    1.7976931348623157e308: "1.7976931348623157E308",
}
READ = {
    "0": 0.0,
    "30": 30.0,
    "-1.5707": -1.5707,
    "9.265358979327931e-05": 9.265358979327931e-05,
    "+3": 3.0,
    "1e-05": 1e-5,
    " 4 ": 4.0,
    "1d": 1.0,
    "2.5F": 2.5,
    ".5": 0.5,
    "5.": 5.0,
    "0x1.8p1": 3.0,
    "-0X.8P0": -0.5,
    "Infinity": math.inf,
    "-Infinity": -math.inf,
    "1e999": math.inf,
    "0x1p9999": math.inf,
    "-0x1p9999": -math.inf,
}
NO_NUMBERS = (
    *(
        "",
        "nan",
        "inf",
        "infinity",
        "1_0",
        "1,5",
        "abc",
        "0x1",
        "--1",
        "1e",
        "e5",
        ".",
        "0xp1",
        "1dd",
        "9" * 401,
        "\u0661",
    ),
)


@pytest.mark.parametrize(("number", "text"), PRINTED.items())
def test_numbers_are_printed_as_java_does(number: float, text: str) -> None:
    assert java_text(number) == text


@given(st.floats(allow_nan=False))
def test_what_is_printed_reads_back_as_the_same_number(number: float) -> None:
    text = java_text(number)
    assert struct.pack("d", java_double(text)) == struct.pack("d", number)
    assert "+" not in text
    assert "e" not in text
    mantissa = text.partition("E")[0].lstrip("-")
    assert math.isinf(number) or (mantissa.count(".") == 1 and not mantissa.startswith(".") and mantissa[-1] != ".")
    assert math.isinf(number) or ("E" in text) == (number != 0.0 and not 1e-3 <= abs(number) < 1e7)


@pytest.mark.parametrize(("text", "number"), READ.items())
def test_numbers_are_read_as_java_does(text: str, number: float) -> None:
    assert java_double(text) == number


def test_not_a_number_has_one_spelling() -> None:
    assert math.isnan(java_double("NaN"))
    assert math.isnan(java_double("-NaN"))


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_what_java_does_not_read_is_no_number(text: str) -> None:
    with pytest.raises(ValueError, match="number"):
        java_double(text)


@given(st.text())
def test_reading_a_number_raises_nothing_else(text: str) -> None:
    try:
        java_double(text)
    except ValueError:
        return


def test_replies_are_bytes_as_a_published_server_writes_them() -> None:
    assert (DONE, NAK, INTERRUPTED) == (b"done\n", b"nak\n", b"interrupted\n")
    assert pin_reply(True) == b"1\n\n"
    assert pin_reply(False) == b"0\n\n"
    assert (
        values_reply((0.01, -0.02, 3e-5, 0.5, -0.25, 0.125, 0.0625)) == b"0.01_-0.02_3.0E-5_0.5_-0.25_0.125_0.0625_\n"
    )
    longest = values_reply((-1.2345678901234567e-300,) * 7)
    assert len(longest) <= REPLY_MOST_BYTES


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b"\xc2\x85", b"\xe2\x80\xa8", b"\xe2\x80\xa9"])
def test_a_line_ends_where_java_ends_it(end: bytes) -> None:
    lines = LineCutter().feed(b"Eef_pos" + end + b"getPin3" + end)
    assert [line for line in lines if line] == [b"Eef_pos", b"getPin3"]


@given(st.binary(max_size=400), st.lists(st.integers(0, 400), max_size=6))
def test_lines_do_not_depend_on_how_tcp_cut_them(data: bytes, cuts: list[int]) -> None:
    whole = LineCutter(20).feed(data + b"\n")
    places = sorted({0, *(min(cut, len(data)) for cut in cuts), len(data)})
    cutter = LineCutter(20)
    parts = [line for a, b in pairwise(places) for line in cutter.feed(data[a:b])]
    assert parts + cutter.feed(b"\n") == whole


@given(st.lists(st.binary(max_size=3000), max_size=8))
def test_memory_is_bounded_whatever_comes(chunks: list[bytes]) -> None:
    cutter = LineCutter()
    for chunk in chunks:
        lines = cutter.feed(chunk)
        assert all(line is None or len(line) <= LINE_MOST_BYTES for line in lines)
        assert len(cutter.open_line) <= LINE_MOST_BYTES + 3


def test_a_line_too_long_is_told_once_and_the_next_one_is_read() -> None:
    cutter = LineCutter()
    assert cutter.feed(b"x" * 3000) == [None]
    assert cutter.open_line == b""
    assert cutter.feed(b"x" * 3000) == []
    assert cutter.feed(b"yz\nEef_pos\n") == [b"Eef_pos"]
    assert cutter.feed(b"y" * (LINE_MOST_BYTES + 1) + b"\nend\n") == [None, b"end"]
    assert cutter.feed(b"y" * LINE_MOST_BYTES + b"\n") == [b"y" * LINE_MOST_BYTES]


LINES = {
    b"end": (Command.END, ()),
    b"blueOn": (Command.SET_OUTPUT, ()),
    b"pin12off": (Command.SET_OUTPUT, ()),
    b"getPin16": (Command.READ_INPUT, ()),
    b"getJointsPositions": (Command.QUERY, ()),
    b"Eef_pos": (Command.QUERY, ()),
    b"Torques_m_J": (Command.QUERY, ()),
    b"jRelVel_0.1_": (Command.SET_SPEED, (0.1,)),
    b"jp_0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_": (Command.SET_JOINTS, (0.0, 0.0, 0.0, -1.5707, 0.0, 1.5708, 0.0)),
    b"jpEEfFrelEEF_1_2_3_4_5_6_7": (Command.SET_JOINTS, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)),
    b"jpEEfP__1__2_3_4_5_6_7__": (Command.SET_JOINTS, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)),
    b"velJDCExT_0_0_0_0_0_0_0_": (Command.SET_VELOCITIES, (0.0,) * 7),
    b"cArtixanPosition_1_2_3_4_5_6_": (Command.SET_POSE, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    b"cArtixanPositionCirc1_1_2_3_4_5_6_": (Command.SET_CIRCLE_AUXILIARY, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    b"cArtixanPositionCirc2_1_2_3_4_5_6_": (Command.SET_CIRCLE_END, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    b"DcSeCar_1_2_3_4_5_6_": (Command.SET_SERVO_POSE, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    b"DcSeCarW_1_2_3_4_5_6_": (Command.SET_SERVO_POSE, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
    b"TFtrans_50_25_0_0_0_0": (Command.ATTACH_TOOL, (50.0, 25.0, 0.0, 0.0, 0.0, 0.0)),
    b"doPTPinJS": (Command.MOVE_JOINTS, ()),
    b"doPTPinCS": (Command.MOVE_LINE, ()),
    b"doPTPinCSRelBase": (Command.MOVE_LINE_IN_BASE, ()),
    b"doPTPinCSRelEEF": (Command.MOVE_LINE_IN_TOOL, ()),
    b"doPTPinCSCircle1_": (Command.MOVE_CIRCLE, ()),
    b"doPTP!inJS_1_-20_20": (Command.MOVE_JOINTS_UNTIL, (1.0, -20.0, 20.0)),
    b"doPTP!inCS_": (Command.MOVE_LINE_UNTIL, ()),
    b"doPTP!inCSRelBase_0_-1_1": (Command.MOVE_LINE_UNTIL, (0.0, -1.0, 1.0)),
    b"doPTP!CSCircle1_0_-1_1": (Command.MOVE_CIRCLE_UNTIL, (0.0, -1.0, 1.0)),
    b"startDirectServoJoints": (Command.START_JOINT_SERVO, ()),
    b"stDcEEf_": (Command.START_CARTESIAN_SERVO, ()),
    b"stVelDcJoint_": (Command.START_VELOCITY_SERVO, ()),
    b"startSmartImpedneceJoints_1.0_0_0_0_900_80_50_": (
        Command.START_IMPEDANCE,
        (1.0, 0.0, 0.0, 0.0, 900.0, 80.0, 50.0),
    ),
    b"startSmartImpedanceJoints_1.0_0_0_0_900_80_50_": (
        Command.START_IMPEDANCE,
        (1.0, 0.0, 0.0, 0.0, 900.0, 80.0, 50.0),
    ),
    b"stopDirectServoJoints": (Command.STOP_SERVO, ()),
    b"handGuiding": (Command.HAND_GUIDING, ()),
    b"preciseHandGuiding1_-10.0_0_0_0.05": (Command.HAND_GUIDING, ()),
}


@pytest.mark.parametrize(("line", "asked"), LINES.items())
def test_lines_and_what_they_ask_for(line: bytes, asked: tuple[Command, tuple[float, ...]]) -> None:
    request = read_request(line)
    assert isinstance(request, Request)
    assert (request.spec.command, request.values) == asked


WRONG = {
    b"foo": (Problem.UNKNOWN, "there is no command 'foo'"),
    b"getPin5": (Problem.UNKNOWN, "no command"),
    b"Eef_pos_": (Problem.UNKNOWN, "Eef_pos stands alone in its line"),
    b"Eef_pos ": (Problem.UNKNOWN, "stands alone"),
    b"dopTPinjs": (Problem.UNKNOWN, "did you mean doPTPinJS?"),
    b"jp_1_2_3_": (Problem.TOO_FEW, "jp has 3 values, 7 are needed"),
    b"jp_1_2_3_4_5_6_7_8_": (Problem.TOO_MANY, "jp has 8 values, 7 are needed"),
    b"jp_1_2_x_4_5_6_7_": (Problem.NO_NUMBER, "value 3 of jp is 'x', which is no number"),
    b"jp_1_2_nan_4_5_6_7_": (Problem.NO_NUMBER, "'nan'"),
    b"DcSeCarExT_1_2_NaN_4_5_6_": (Problem.NOT_FINITE, "value 3 of DcSeCarExT is nan, a finite number is needed"),
    b"jf_1_2_3_4_5_6_Infinity_": (Problem.NOT_FINITE, "inf"),
    b"jRelVel_": (Problem.TOO_FEW, "0 values, 1 are needed"),
    b"doPTP!inJS_1_-20": (Problem.TOO_FEW, "triplets"),
    b"doPTP!inJS" + b"_0_1_2" * 8: (Problem.TOO_MANY, "24 values"),
    b"Eef_pos\x00": (Problem.NOT_TEXT, "printable ASCII"),
    "Eef_pos\u00e9".encode(): (Problem.NOT_TEXT, "printable ASCII"),
    bytes(range(128, 200)): (Problem.NOT_TEXT, "printable ASCII"),
}


@pytest.mark.parametrize(("line", "told"), WRONG.items())
def test_what_is_wrong_with_a_line_is_said(line: bytes, told: tuple[Problem, str]) -> None:
    refused = read_request(line)
    assert isinstance(refused, Refused)
    assert refused.problem is told[0]
    assert told[1] in refused.sentence


@given(st.binary(max_size=1100))
def test_reading_a_line_never_raises(line: bytes) -> None:
    assert isinstance(read_request(line), Request | Refused | None)


@given(st.sampled_from(COMMANDS), st.text("0123456789._-+eENaIfity", max_size=80))
def test_reading_a_command_never_raises(spec: object, rest: str) -> None:
    line = spec.token + rest  # type: ignore[attr-defined]
    assert isinstance(read_request(line.encode()), Request | Refused)


def test_no_line_is_an_empty_one() -> None:
    assert read_request(b"") is None


def test_only_streams_have_no_reply_besides_the_end() -> None:
    silent = {spec.token for spec in COMMANDS if spec.reply is Feedback.NOTHING}
    assert silent == {"end", "jf_", "DcSeCar_"}


def test_no_command_hides_behind_one_that_comes_before_it() -> None:
    for spec in COMMANDS:
        found = read_request(spec.token.encode())
        assert found is not None
        assert found.spec is spec, spec.token
