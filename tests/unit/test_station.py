"""Station files: the template is the defaults, and every mistake ends in one sentence that names it."""

import tomllib
from pathlib import Path

import pytest

from backends.robots import robot_names
from hil.cli.run import ServoOptions, station_of
from hil.config.station import Station, load_station, parse_station
from hil.config.template import TEMPLATE
from hil.runtime.assembly import BACKENDS
from hil.values.errors import ConfigurationError
from hil.values.fri import Release


def test_the_template_is_the_defaults_and_names_every_choice() -> None:
    written = parse_station(tomllib.loads(TEMPLATE), where="template")
    assert written == Station.model_validate({"robot": [{"fri": {}, "servo": {}}]})
    for choice in (
        *robot_names(),
        *BACKENDS,
        *Release,
        "T1",
        "T2",
        "AUT",
        "skip",
        "catch-up",
        "fault",
        "joint-position",
        "cabinet",
        "ideal",
    ):
        assert choice in TEMPLATE


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("robot = 3", "robot: Input should be a valid list"),
        ("", "robot: Field required"),
        ("[[robot]]\nnmae = 'x'", "robot[1].nmae: there is no such key"),
        ("[[robot]]\nmode = 'T3'", "robot[1].mode: Input should be 'T1', 'T2' or 'AUT', got 'T3'"),
        ("[[robot]]\ncycle_ms = 3", "robot[1]: control cycle 3 ms is none of 1, 2, 4, 5 ms"),
        ("[[robot]]\n[robot.fri]\nrelease = '1.12'", "robot[1].fri.release: Input should be '1.11', '1.14'"),
        ("[[robot]]\n[robot.fri]\nsend_period_ms = 0", "robot[1].fri: send period 0 ms is outside 1..100 ms"),
        (
            "[[robot]]\ncycle_ms = 2\n[robot.fri]\nsend_period_ms = 5",
            "robot[1]: send period 5 ms is no multiple of the control cycle of 2 ms",
        ),
        (
            "[[robot]]\n[robot.fri]\nsend_period_ms = 50\nreceive_multiplier = 3",
            "send period 50 ms x receive multiplier 3 = 150 ms is more than 100 ms",
        ),
        ("[[robot]]\n[[robot]]", "two robots have the name 'arm'; each needs its own"),
        ("[[robot]]\ncycle_ms = true", "robot[1].cycle_ms: Input should be a valid integer, got True"),
        ("[[robot]]\nseed = -1", "robot[1].seed: Input should be greater than or equal to 0"),
        ("[[robot]]\nseed = " + "9" * 5000, "is no TOML"),
        ("x = " + "[" * 5000, "is no TOML"),
        ('capture = "a\\u0000b"\n[[robot]]', "has a NUL in its name"),
        (
            '[[robot]]\n[robot.fri]\n[[robot]]\nname = "b"\n[robot.fri]',
            "two robots have the FRI client '127.0.0.1:30200'; each needs its own",
        ),
        ("[[robot]]\nname = 5", "robot[1].name: Input should be a valid string, got 5"),
        ("robot = [", "is no TOML"),
    ],
)
def test_a_bad_file_ends_in_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    file = tmp_path / "station.toml"
    file.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load_station(file)
    assert sentence in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_binary_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"cannot read station file .*nowhere\.toml"):
        load_station(tmp_path / "nowhere.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match=r"cannot read station file .*binary\.toml"):
        load_station(tmp_path / "binary.toml")


TWO = """
[[robot]]
name = "left"
[robot.fri]
client = "127.0.0.1:30201"
[[robot]]
name = "right"
backend = "ideal"
"""


def test_options_override_the_file(tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(TWO)
    station = station_of(
        file,
        robot={"mode": "T1"},
        fri={"send_period_ms": 4},
        servo=ServoOptions(),
        capture=Path("c.pcapng"),
        realtime=True,
    )
    assert [robot.mode for robot in station.robot] == ["T1", "T1"]
    assert [robot.backend for robot in station.robot] == ["mujoco", "ideal"]
    assert [None if robot.fri is None else robot.fri.send_period_ms for robot in station.robot] == [4, None]
    assert station.capture == Path("c.pcapng")
    assert station.realtime


def test_an_address_cannot_be_that_of_two_robots(tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(TWO)
    with pytest.raises(ConfigurationError, match="has 2 robots, and --fri-client can be that of one only"):
        station_of(
            file, robot={}, fri={"client": "127.0.0.1:30200"}, servo=ServoOptions(), capture=None, realtime=False
        )


def test_fri_options_need_a_robot_with_fri(tmp_path: Path) -> None:
    file = tmp_path / "plain.toml"
    file.write_text("[[robot]]\n")
    with pytest.raises(ConfigurationError, match="has an FRI link for the FRI options; add --fri-client"):
        station_of(file, robot={}, fri={"send_period_ms": 4}, servo=ServoOptions(), capture=None, realtime=False)
    linked = station_of(
        file, robot={}, fri={"client": "127.0.0.1:30203"}, servo=ServoOptions(), capture=None, realtime=False
    )
    assert linked.robot[0].fri is not None


def test_without_a_file_there_is_one_robot_with_fri() -> None:
    station = station_of(None, robot={}, fri={}, servo=ServoOptions(), capture=None, realtime=False)
    assert [(robot.name, robot.model, robot.backend) for robot in station.robot] == [
        ("arm", "lbr-iiwa-14-r820", "mujoco")
    ]
    assert station.robot[0].fri is not None


def test_either_link_can_be_left_out() -> None:
    no_fri = station_of(None, robot={}, fri={"client": "off"}, servo=ServoOptions(), capture=None, realtime=False)
    assert (no_fri.robot[0].fri, no_fri.robot[0].servo is None) == (None, False)
    no_servo = station_of(None, robot={}, fri={}, servo=ServoOptions("off"), capture=None, realtime=False)
    assert (no_servo.robot[0].servo, no_servo.robot[0].fri is None) == (None, False)
    with pytest.raises(ConfigurationError, match="--fri-client off leaves nothing"):
        station_of(
            None,
            robot={},
            fri={"client": "off", "send_period_ms": 2},
            servo=ServoOptions(),
            capture=None,
            realtime=False,
        )
