"""Station files: the template is the defaults, and every mistake ends in one sentence that names it."""

import math
import re
import tomllib
from pathlib import Path

import pytest

from backends.registry import backend_names
from backends.robots import load_description, robot_names
from hil.cli.run import ServoOptions, chosen_controls, station_of
from hil.config.control import ControlName
from hil.config.limits import LimitsConfig
from hil.config.station import RobotConfig, Station, load_station, parse_station
from hil.config.template import TEMPLATE
from hil.runtime.assembly import open_parts, robot_description
from hil.values.control import (
    CartesianImpedanceControlMode,
    ControlModeSettings,
    JointImpedanceControlMode,
    PositionControlMode,
)
from hil.values.errors import ConfigurationError
from hil.values.fri import IODirection, IOType, OverlayKind, Release
from hil.values.link import Address
from hil.values.signals import Signal
from hil.values.tcp_probe import Behaviour

IO = "[[robot]]\n[[robot.io]]\nname = 'G'\n[[robot.io.signal]]\nname = 'x'\n"
ELEVEN = ", ".join(f"{{name = '{number}', type = 'digital', direction = 'input'}}" for number in range(11))


def test_the_template_is_the_defaults_and_names_every_choice() -> None:
    written = parse_station(tomllib.loads(TEMPLATE), where="template")
    assert written == Station.model_validate({"robot": [{"fri": {}, "servo": {}}]})
    for choice in (
        *robot_names(),
        *backend_names(),
        *Release,
        "T1",
        "T2",
        "AUT",
        "skip",
        "catch-up",
        "fault",
        *OverlayKind,
        *ControlName,
        "cabinet",
        "ideal",
        *LimitsConfig.model_fields,
        "enabled = false",
        "permissive = false",
        'pad = "off"',
    ):
        assert choice in TEMPLATE


def test_what_the_template_leaves_commented_is_valid_too() -> None:
    text = re.sub(r"^# (\w+ = |\[)", r"\1", TEMPLATE, flags=re.MULTILINE)
    written = parse_station(tomllib.loads(text), where="template")
    assert list(written.robot[0].frames()) == ["world", "base", "flange", "table", "gripper", "tip"]
    limits = written.robot[0].limits
    assert limits.model_fields_set == set(LimitsConfig.model_fields)
    assert limits.tighten(load_description(written.robot[0].model)) == load_description(written.robot[0].model)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("robot = 3", "robot: Input should be a valid list"),
        ("", "robot: Field required"),
        ("[[robot]]\nnmae = 'x'", "robot[1].nmae: there is no such key"),
        ("[[robot]]\nmode = 'T3'", "robot[1].mode: Input should be 'T1', 'T2' or 'AUT', got 'T3'"),
        ("[[robot]]\ncycle_ms = 3", "robot[1]: control cycle 3 ms is none of 1, 2, 4, 5 ms"),
        ("[[robot]]\n[[robot.io]]\nname = 'A.B'", "robot[1]: the I/O group 'A.B' has a dot in its name"),
        (
            f"{IO}type = 'bit'",
            "robot[1].io[1].signal[1].type: Input should be 'boolean', 'digital' or 'analog', got 'bit'",
        ),
        (f"{IO}type = 'digital'\ndirection = 'in'", "direction: Input should be 'input' or 'output', got 'in'"),
        (f"{IO}type = 'digital'\ndirection = 'input'\ninitial = 0.5", "G.x is digital and cannot begin with 0.5"),
        (
            f"{IO}type = 'boolean'\ndirection = 'input'\ninitial = 3",
            "G.x is boolean and cannot begin with 3; valid: true",
        ),
        (f"{IO}type = 'digital'\ndirection = 'input'\ninitial = '1'", "Input should be a valid integer, got '1'"),
        (f"{IO}type = 'boolean'\ndirection = 'input'\nfri = 1", "fri: Input should be a valid boolean"),
        (
            f"[[robot]]\nio = [{{name = 'G', signal = [{ELEVEN}]}}]",
            "robot[1]: FRI shows 11 inputs and outputs, 10 at most",
        ),
        ("[[robot]]\n[robot.fri]\ntransformations = ['a', 'a']", "two transformations have the name 'a'"),
        ("[[robot]]\n[robot.fri]\nrelease = '1.12'", "robot[1].fri.release: Input should be '1.11', '1.14'"),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'torque'\n[robot.fri.control]\nmode = 'position'",
            "robot[1].fri: a torque overlay needs joint impedance control, not position control",
        ),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'cartesian-pose'",
            "robot[1].fri: a cartesian-pose overlay needs a client of release 2.x, not 1.15",
        ),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'pose'",
            "robot[1].fri.overlay: Input should be 'none', 'joint-position', 'torque', 'wrench' or 'cartesian-pose'",
        ),
        (
            "[[robot]]\n[robot.fri.control]\nstiffness = [1, 2, 3, 4, 5, 6, 7]",
            "stiffness is no parameter of the control mode position; it has no parameters",
        ),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'torque'\n[robot.fri.control]\nnull_space_damping = 0.5",
            "null_space_damping is no parameter of the control mode joint-impedance; its parameters are stiffness",
        ),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'torque'\n[robot.fri.control]\nstiffness = [1, 2, 3, 4, 5, 6]",
            "joint stiffness: 6 values given, A1 A2 A3 A4 A5 A6 A7 are 7",
        ),
        (
            "[[robot]]\n[robot.fri]\noverlay = 'wrench'\n[robot.fri.control]\nstiffness = [1, 2, 5001, 4, 5, 6]",
            "translational stiffness Z 5001 is outside its range",
        ),
        (
            "[[robot]]\n[robot.fri.control]\nmode = 'joint-impedance'\ndamping = [1, 1, 1, 1, 1, 1, 1.5]",
            "damping A7 1.5 is outside its range",
        ),
        ("[[robot]]\n[robot.fri.control]\nmodus = 'position'", "robot[1].fri.control.modus: there is no such key"),
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
        ("[[robot]]\nenabled = 1", "robot[1].enabled: Input should be a valid boolean, got 1"),
        ("[[robot]]\npermissive = 'yes'", "robot[1].permissive: Input should be a valid boolean, got 'yes'"),
        ("[[robot]]\n[tcp_probe]\nbehaviour = 'good'", "tcp_probe.bind: Field required"),
        (
            "[[robot]]\n[tcp_probe]\nbind = 'a:1'\nbehaviour = 'bad'",
            "tcp_probe.behaviour: Input should be 'good', 'nagle'",
        ),
        ("pad = true\n[[robot]]", "pad: Input should be a valid string, got True"),
        ("[[robot]]\n[robot.limits]\nspeed = 1", "robot[1].limits.speed: there is no such key"),
        ("[[robot]]\n[robot.limits]\ntorque_nm = [1, 2]", "robot[1].limits.torque_nm: List should have at least 7"),
        ("[[robot]]\n[robot.limits]\nvelocity_deg_s = [nan, 1, 1, 1, 1, 1, 1]", "velocity_deg_s[1]: Input should be"),
        (
            "[[robot]]\n[robot.limits]\nt1_flange_speed_mm_s = 250.1",
            "robot[1].limits.t1_flange_speed_mm_s: Input should be less than or equal to 250, got 250.1",
        ),
        (
            "[[robot]]\n[robot.limits]\nt1_flange_speed_mm_s = 0",
            "t1_flange_speed_mm_s: Input should be greater than or equal to 1",
        ),
        (
            "[[robot]]\n[robot.limits]\ntracking_deg = 6",
            "tracking limit, rad 0.10472 is outside its range > 0 and <= 0.1",
        ),
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
        process={"capture": Path("c.pcapng"), "realtime": True, "pad": "off"},
    )
    assert [robot.mode for robot in station.robot] == ["T1", "T1"]
    assert [robot.backend for robot in station.robot] == ["mujoco", "ideal"]
    assert [None if robot.fri is None else robot.fri.send_period_ms for robot in station.robot] == [4, None]
    assert station.capture == Path("c.pcapng")
    assert station.realtime
    assert station.pad == "off"


def test_options_of_the_tcp_probe_lie_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "probe.toml"
    file.write_text('[tcp_probe]\nbind = "127.0.0.1:30400"\nbehaviour = "nagle"\n[[robot]]\n')

    def probe(**options: object) -> tuple[str, str] | None:
        given = station_of(file, robot={}, fri={}, servo=ServoOptions(), process={}, tcp_probe=options).tcp_probe
        return None if given is None else (given.bind, given.behaviour)

    assert probe() == ("127.0.0.1:30400", "nagle")
    assert probe(behaviour=Behaviour.GOOD) == ("127.0.0.1:30400", "good")
    assert probe(bind="127.0.0.1:1") == ("127.0.0.1:1", "nagle")
    assert probe(bind="off") is None
    with pytest.raises(ConfigurationError, match="--tcp-probe off leaves nothing for --tcp-probe-behaviour to say"):
        probe(bind="off", behaviour=Behaviour.NAGLE)


def test_an_address_cannot_be_that_of_two_robots(tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(TWO)
    with pytest.raises(ConfigurationError, match="has 2 robots, and --fri-client can be that of one only"):
        station_of(file, robot={}, fri={"client": "127.0.0.1:30200"}, servo=ServoOptions(), process={})


def test_fri_options_need_a_robot_with_fri(tmp_path: Path) -> None:
    file = tmp_path / "plain.toml"
    file.write_text("[[robot]]\n")
    with pytest.raises(ConfigurationError, match="has an FRI link for the FRI options; add --fri-client"):
        station_of(file, robot={}, fri={"send_period_ms": 4}, servo=ServoOptions(), process={})
    linked = station_of(file, robot={}, fri={"client": "127.0.0.1:30203"}, servo=ServoOptions(), process={})
    assert linked.robot[0].fri is not None


def test_without_a_file_there_is_one_robot_with_fri() -> None:
    station = station_of(None, robot={}, fri={}, servo=ServoOptions(), process={})
    assert [(robot.name, robot.model, robot.backend) for robot in station.robot] == [
        ("arm", "lbr-iiwa-14-r820", "mujoco")
    ]
    assert station.robot[0].fri is not None


def test_either_link_can_be_left_out() -> None:
    no_fri = station_of(None, robot={}, fri={"client": "off"}, servo=ServoOptions(), process={})
    assert (no_fri.robot[0].fri, no_fri.robot[0].servo is None) == (None, False)
    no_servo = station_of(None, robot={}, fri={}, servo=ServoOptions("off"), process={})
    assert (no_servo.robot[0].servo, no_servo.robot[0].fri is None) == (None, False)
    with pytest.raises(ConfigurationError, match="--fri-client off leaves nothing"):
        station_of(
            None,
            robot={},
            fri={"client": "off", "send_period_ms": 2},
            servo=ServoOptions(),
            process={},
        )


def kst(file: Path | None = None, **options: object) -> Station:
    return station_of(file, robot={}, fri={}, servo=ServoOptions(), process={}, kst=options)


def test_a_kst_server_is_laid_over_a_station(tmp_path: Path) -> None:
    assert kst().robot[0].kst is None
    given = kst(bind="127.0.0.1", strict=True).robot[0].kst
    assert given is not None
    assert (given.bind, given.strict, given.nagle) == ("127.0.0.1", True, False)
    settings = given.settings(robot_description(RobotConfig()))
    assert (settings.strict, settings.nagle, settings.motion_gap_ns) == (True, True, 0)
    assert settings.position_max_rad[1] == pytest.approx(math.radians(120.0))
    assert settings.velocity_max_rad_s[0] == pytest.approx(math.radians(85.0))
    file = tmp_path / "station.toml"
    file.write_text('[[robot]]\nservo = {}\nkst = { watchdog_ms = 50 }\n[[robot]]\nname = "two"\n')
    nagle = kst(file, nagle=True)
    assert nagle.robot[0].kst is not None
    assert (nagle.robot[0].kst.watchdog_ms, nagle.robot[0].kst.nagle, nagle.robot[1].kst) == (50, True, None)
    assert [robot.kst for robot in kst(file, bind="off").robot] == [None, None]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"bind": "off", "strict": True}, "--kst off leaves nothing for the other KST options to say"),
        ({"nagle": True}, "there is no KST server for the KST options; add --kst"),
        ({"bind": "127.0.0.1", "watchdog_ms": -1}, "watchdog_ms"),
    ],
)
def test_kst_options_that_cannot_be(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        kst(None, **options)


def test_a_kst_server_is_one_robot_s_and_needs_the_servo_link(tmp_path: Path) -> None:
    file = tmp_path / "station.toml"
    file.write_text('[[robot]]\nservo = {}\n[[robot]]\nname = "two"\nservo = { bind = "127.0.0.1:30301" }\n')
    with pytest.raises(ConfigurationError, match="2 robots, and --kst can be that of one only"):
        kst(file, bind="127.0.0.1")
    with pytest.raises(ConfigurationError, match="commands the arm through the servo link, and needs one"):
        station_of(None, robot={}, fri={}, servo=ServoOptions("off"), process={}, kst={"bind": "127.0.0.1"})
    both = {"robot": [{"servo": {}, "kst": {}}, {"name": "two", "servo": {"bind": "127.0.0.1:30301"}, "kst": {}}]}
    with pytest.raises(ConfigurationError, match=r"two robots have the KST address '127\.0\.0\.1:30001'"):
        parse_station(both, where="test")


def control_of(station: Station) -> ControlModeSettings:
    """What the first robot is controlled with under its FRI overlay."""
    fri = station.robot[0].fri
    assert fri is not None
    return fri.settings(Address("127.0.0.1", 30200)).control


def laid(file: Path | None, **fri: object) -> Station:
    return station_of(file, robot={}, fri=fri, servo=ServoOptions(), process={})


def test_an_overlay_gets_the_control_mode_it_needs_and_that_is_said() -> None:
    plain = laid(None)
    assert (control_of(plain), chosen_controls(plain)) == (PositionControlMode(), [])
    torque, wrench = laid(None, overlay="torque"), laid(None, overlay="wrench")
    assert control_of(torque) == JointImpedanceControlMode()
    assert control_of(wrench) == CartesianImpedanceControlMode()
    assert chosen_controls(torque) + chosen_controls(wrench) == [
        "arm: a torque overlay needs joint-impedance; taken, of default stiffness and damping",
        "arm: a wrench overlay needs cartesian-impedance; taken, of default stiffness and damping",
    ]
    asked = laid(None, overlay="torque", control={"mode": "joint-impedance"})
    assert (control_of(asked), chosen_controls(asked)) == (JointImpedanceControlMode(), [])
    under = laid(None, control={"mode": "cartesian-impedance"})
    assert control_of(under) == CartesianImpedanceControlMode()


def test_the_parameters_of_a_file_stay_when_options_name_the_mode(tmp_path: Path) -> None:
    file = tmp_path / "stiff.toml"
    file.write_text(
        "[[robot]]\n[robot.fri]\noverlay = 'wrench'\n[robot.fri.control]\n"
        "stiffness = [100, 200, 300, 10, 20, 30]\ndamping = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]\n"
        "null_space_stiffness_nm_rad = 5\nnull_space_damping = 0.4\n"
        "additional_control_force = [1, 2, 3, 0.1, 0.2, 0.3]\nmax_control_force = [50, 50, 50, 5, 5, 5]\n"
        "stop_on_max_control_force = true\nmax_cartesian_velocity = [10, 20, 30, 1, 2, 3]\n"
        "max_path_deviation = [5, 6, 7, 0.1, 0.2, 0.3]\n"
    )
    expected = CartesianImpedanceControlMode(
        stiffness=(100, 200, 300, 10, 20, 30),
        damping=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
        null_space_stiffness_nm_rad=5,
        null_space_damping=0.4,
        additional_control_force=(1, 2, 3, 0.1, 0.2, 0.3),
        max_control_force=(50, 50, 50, 5, 5, 5),
        stop_on_max_control_force=True,
        max_cartesian_velocity=(10, 20, 30, 1, 2, 3),
        max_path_deviation=(5, 6, 7, 0.1, 0.2, 0.3),
    )
    assert control_of(laid(file)) == expected
    assert chosen_controls(laid(file)) == ["arm: a wrench overlay needs cartesian-impedance; taken, as set"]
    assert control_of(laid(file, control={"mode": "cartesian-impedance"})) == expected
    with pytest.raises(ConfigurationError, match="null_space_stiffness_nm_rad is no parameter of the control mode"):
        laid(file, overlay="torque")


def limits(**keys: object) -> LimitsConfig:
    return LimitsConfig.model_validate(keys)


def test_what_an_operator_begins_with_comes_from_file_and_options(tmp_path: Path) -> None:
    plain = station_of(None, robot={}, fri={}, servo=ServoOptions(), process={})
    assert (plain.pad, plain.robot[0].enabled, plain.robot[0].permissive) == (None, False, False)
    given = station_of(
        None, robot={"mode": "T1", "enabled": True, "permissive": True}, fri={}, servo=ServoOptions(), process={}
    )
    settings = given.robot[0].settings(unix_epoch_ns=0, fri_peer=None, servo=None)
    assert (settings.enabled, settings.safety.permissive) == (True, True)
    file = tmp_path / "pad.toml"
    file.write_text('pad = "/run/arm.sock"\n[[robot]]\nenabled = true\npermissive = true\n')
    kept = station_of(file, robot={}, fri={}, servo=ServoOptions(), process={})
    assert (kept.pad, kept.robot[0].enabled, kept.robot[0].permissive) == ("/run/arm.sock", True, True)


def test_limits_tighten_a_robot_and_leave_the_rest() -> None:
    robot = load_description("lbr-iiwa-14-r820")
    own = robot.limits
    assert limits().tighten(robot) == robot
    tighter = limits(
        position_min_deg=[-10, -20, -30, -120, -170, -120, -175],
        position_max_deg=[170, 120, 170, 50, 170, 120, 175],
        velocity_deg_s=[10, 85, 100, 75, 130, 135, 135],
        torque_nm=[320, 100, 176, 176, 110, 40, 40],
    ).tighten(robot)
    taken = tighter.limits
    assert taken.position_min_rad[:3] == pytest.approx([math.radians(-value) for value in (10, 20, 30)])
    assert taken.position_min_rad[3:] == own.position_min_rad[3:]
    assert taken.position_max_rad[3] == pytest.approx(math.radians(50))
    assert taken.velocity_rad_s == pytest.approx((math.radians(10), *own.velocity_rad_s[1:]))
    assert list(taken.torque_nm) == [320.0, 100.0, 176.0, 176.0, 110.0, 40.0, 40.0]
    assert taken.acceleration_rad_s2 == own.acceleration_rad_s2
    assert robot.limits is own


@pytest.mark.parametrize("name", robot_names())
def test_a_robots_own_limits_in_round_degrees_change_nothing(name: str) -> None:
    own = load_description(name).limits
    same = limits(
        position_min_deg=[round(math.degrees(value), 6) for value in own.position_min_rad],
        position_max_deg=[round(math.degrees(value), 6) for value in own.position_max_rad],
        velocity_deg_s=[round(math.degrees(value), 6) for value in own.velocity_rad_s],
        torque_nm=list(own.torque_nm),
    )
    assert same.tighten(load_description(name)).limits == own


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"position_min_deg": [-171, -120, -170, -120, -170, -120, -175]}, "position_min_deg of A1 -171 is outside"),
        ({"position_max_deg": [170, 120, 170, 120, 170, 120, 176]}, "<= 175, which is the robot's own"),
        ({"velocity_deg_s": [85, 86, 100, 75, 130, 135, 135]}, "velocity_deg_s of A2 86 is outside"),
        (
            {"velocity_deg_s": [85, 85, 0, 75, 130, 135, 135]},
            "velocity_deg_s of A3 0 is outside its range >= 0.1 and <=",
        ),
        ({"torque_nm": [320, 320, 176, 176, 110, 40, 41]}, "a station tightens limits only"),
        ({"torque_nm": [320, 320, 176, 176, 110, -1, 40]}, "torque_nm of A6 -1 is outside its range >= 0.1 and <= 40"),
        (
            {"position_max_deg": [170, 29, 170, 120, 170, 120, 175]},
            "limits of A2: lbr-iiwa-14-r820 begins at 30 degrees, which is outside -120 ... 29",
        ),
    ],
)
def test_what_widens_a_limit_or_leaves_out_the_start_is_refused(keys: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        limits(**keys).tighten(load_description("lbr-iiwa-14-r820"))
    assert sentence in str(caught.value)


def test_limits_of_a_station_reach_the_robot_and_its_monitors() -> None:
    station = parse_station(
        {"robot": [{"limits": {"t1_flange_speed_mm_s": 100.0, "tracking_deg": 2.0, "torque_nm": [1.0] * 7}}]}, where="x"
    )
    config = station.robot[0]
    assert robot_description(config).limits.torque_nm == (1.0,) * 7
    safety = config.settings(unix_epoch_ns=0, fri_peer=None, servo=None).safety
    assert safety.t1_flange_speed_mm_s == 100.0
    assert safety.tracking_rad == pytest.approx(math.radians(2.0))
    with pytest.raises(ConfigurationError, match="velocity_deg_s of A1 500 is outside"):
        open_parts(config.model_copy(update={"limits": limits(velocity_deg_s=[500.0] * 7)}))


def test_inputs_outputs_and_transformations_reach_the_core() -> None:
    text = f"{IO}type = 'analog'\ndirection = 'output'\ninitial = 1\n[[robot.io.signal]]\nname = 'y'\ntype = 'boolean'"
    text += "\ndirection = 'input'\nfri = false\n[robot.fri]\ntransformations = ['PBase']"
    robot = parse_station(tomllib.loads(text), where="file").robot[0]
    settings = robot.settings(unix_epoch_ns=0, fri_peer=Address("127.0.0.1", 30200), servo=None)
    assert settings.signals == (
        Signal("G.x", IOType.ANALOG, IODirection.OUTPUT, 1),
        Signal("G.y", IOType.BOOLEAN, IODirection.INPUT, False, False),
    )
    assert settings.fri is not None
    assert settings.fri.transformations == ("PBase",)


def test_names_that_fit_one_release_may_be_too_long_for_another() -> None:
    content = {
        "robot": [
            {
                "io": [{"name": "G", "signal": [
                    {"name": f"{number}" * 61, "type": "digital", "direction": "output"} for number in range(10)
                ]}],
                "fri": {"release": "1.11", "transformations": ["PBase"]},
            }
        ]
    }  # fmt: skip
    # 1.11 lists no inputs and outputs.
    parse_station(content, where="file")
    content["robot"][0]["fri"]["release"] = "2.7"  # type: ignore[index]
    parse_station(content, where="file")
    content["robot"][0]["fri"]["release"] = "1.15"  # type: ignore[index]
    with pytest.raises(ConfigurationError, match=r"may have 15\d\d bytes, 1500 at most; shorten or leave out some"):
        parse_station(content, where="file")
