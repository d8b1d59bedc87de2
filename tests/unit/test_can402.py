"""Seven CiA 402 drives: tables, scaling, bus load, and each way in which a drive or the bus fails."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from backends.can402 import PLUGIN, objects
from backends.can402.backend import Can402Backend
from backends.can402.bus_load import bus_load, check_bus_load, frame_bits
from backends.can402.error_codes import error_in_words
from backends.can402.options import AxisOptions, Can402Options, parse_options
from backends.can402.scaling import AxisScale
from backends.can402.simulated import EDS, DriveFault, SimulatedDrive
from backends.can402.simulated.drive import QUICK_STOP_NS
from backends.can402.state_machine import DRIVE_STATES, ENABLE, TO_ENABLED, TO_OFF, PowerState, power_state
from backends.can402.wire import BUS_OFF, Frame
from backends.robots import load_description
from hil.values.arm import ArmState, JointCommand, seven
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import DriveState
from hil.values.motion import MotionKind
from hil.values.robot import RobotDescription
from tests.support.servo_virtual import Application, ServoBench
from tools.conformance.simulated_drives import SimulatedDrivesRig

ROBOT = load_description("lbr-iiwa-7-r800")
CYCLE_NS = 4_000_000
STILL = (0.0,) * 7


def opened(rig: SimulatedDrivesRig | None = None) -> SimulatedDrivesRig:
    rig = rig or SimulatedDrivesRig(ROBOT)
    rig.open(period_ns=CYCLE_NS)
    rig.get_ready()
    return rig


def hold(rig: SimulatedDrivesRig, cycles: int = 10) -> ArmState:
    for _ in range(cycles):
        state = rig.cycle(JointCommand(rig.backend.read().position_rad, STILL))
    return state


def test_a_cycle_on_the_bus_is_what_the_paper_says() -> None:
    # By hand: 55 for the SYNC; 6 bytes: 47 + 48 + 20; 8 bytes: 47 + 64 + 24.
    assert [frame_bits(count) for count in (0, 6, 8)] == [55, 115, 135]
    load = bus_load(bitrate=1_000_000, period_ns=CYCLE_NS)
    assert (load.frames, load.bits) == (22, 55 + 7 * (115 + 115 + 135))
    assert load.share == pytest.approx(0.6525)


@pytest.mark.parametrize(
    ("bitrate", "period_ms", "sentence"),
    [
        (1_000_000, 1, "22 frames of 2610 bits in a cycle of 1 ms: 261 % of the bus at 1000 kbit/s, 90 % are allowed"),
        (1_000_000, 1, "what would fit: 4 ms"),
        (500_000, 4, "130 % of the bus at 500 kbit/s, 90 % are allowed; what would fit: 800 kbit/s"),
        (125_000, 5, "what would fit: 800 kbit/s"),
    ],
)
def test_a_cycle_that_does_not_fit_is_refused_with_the_figure(bitrate: int, period_ms: int, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        check_bus_load(bitrate=bitrate, period_ns=period_ms * 1_000_000)
    assert sentence in str(refused.value)


@given(
    st.floats(-3.0, 3.0),
    st.integers(1 << 10, 1 << 20),
    st.floats(50.0, 160.0),
    st.sampled_from([1, -1]),
    st.floats(-1.0, 1.0),
)
def test_counts_and_radians_are_each_others_inverse(
    position_rad: float, counts: int, gear: float, sign: int, offset_rad: float
) -> None:
    scale = AxisScale(AxisOptions(counts_per_turn=counts, gear=gear, sign=sign, offset_rad=offset_rad))
    assert scale.reaches(position_rad)
    back = scale.position_rad(scale.counts(position_rad))
    assert abs(back - position_rad) <= 0.5001 / abs(scale.counts_per_rad)
    assert scale.counts(back) == scale.counts(position_rad)


def test_the_sign_of_an_axis_turns_position_velocity_and_torque() -> None:
    plus, minus = AxisScale(AxisOptions()), AxisScale(AxisOptions(sign=-1))
    assert plus.counts(0.5) == -minus.counts(0.5) > 0
    assert plus.velocity_rad_s(1000) == -minus.velocity_rad_s(1000) > 0
    assert plus.motor_torque_nm(250) == -minus.motor_torque_nm(250) == pytest.approx(25.0)


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, PowerState.NOT_READY),
        (0x0250, PowerState.DISABLED),
        (0x0231, PowerState.READY),
        (0x0233, PowerState.SWITCHED_ON),
        (0x1637, PowerState.ENABLED),
        (0x0017, PowerState.QUICK_STOP),
        (0x021F, PowerState.FAULT_REACTION),
        (0x0218, PowerState.FAULT),
        (0x0024, PowerState.UNKNOWN),
    ],
)
def test_a_status_word_says_its_state(word: int, state: PowerState) -> None:
    assert power_state(word) is state


def test_each_state_has_a_way_on_and_a_way_off() -> None:
    assert set(TO_ENABLED) == set(TO_OFF) == set(DRIVE_STATES) == set(PowerState)
    drive = SimulatedDrive(3)
    drive.receive(Frame(0, bytes([1, 3])), period_ns=CYCLE_NS)
    for wanted in (PowerState.READY, PowerState.SWITCHED_ON, PowerState.ENABLED, PowerState.ENABLED):
        drive._obey(TO_ENABLED[drive.state])
        assert drive.state is wanted
    drive._obey(TO_OFF[drive.state])
    assert drive.state is PowerState.QUICK_STOP
    drive.passed(QUICK_STOP_NS)
    assert power_state(0x40) is drive.state
    drive.fail(0x2310)
    for word, wanted in (
        (ENABLE, PowerState.FAULT),
        (0x06, PowerState.FAULT),
        (0x00, PowerState.FAULT),
        (0x80, PowerState.DISABLED),
    ):
        drive._obey(word)
        assert drive.state is wanted, "a fault is left by a reset alone"


def test_error_codes_have_words() -> None:
    assert error_in_words(0x8611) == "fault 0x8611 (following error)"
    assert error_in_words(0x2399) == "fault 0x2399 (current)"
    assert error_in_words(0x1234) == "fault 0x1234"
    assert error_in_words(0) == "fault without a code"


def test_the_drives_measure_velocity_and_torque_in_the_signs_of_the_arm() -> None:
    options = Can402Options(simulated=True, axis=(AxisOptions(sign=-1), *(AxisOptions(),) * 6))
    rig = opened(SimulatedDrivesRig(ROBOT, options))
    start = rig.backend.read().position_rad
    for count in range(1, 50):
        state = rig.cycle(JointCommand(seven([value + count * 4e-4 for value in start]), (0.1,) * 7))
    assert state.velocity_rad_s == pytest.approx((0.1,) * 7, abs=2e-3)
    # The motor pushes against friction, towards plus; the sensor shows the opposite (facts 4.4).
    assert state.torque_nm[1] == pytest.approx(-0.2, abs=0.11)
    rig.close()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (DriveFault.LOST, r"^node 4 \(A4\) is lost: no answer to the last 3 SYNCs$"),
        (DriveFault.OTHER_NODE, r"^node 5 \(A5\) answers more often than it is asked: two drives have the same node"),
        (DriveFault.STRANGER, r"^the bus carries process data of node 99, which is none of this station's \(1, 2, 3"),
    ],
)
def test_a_drive_that_goes_wrong_stops_all_and_is_named(fault: DriveFault, sentence: str) -> None:
    rig = opened()
    rig.drives.drives[3].faults.add(fault)
    hold(rig)
    condition = rig.backend.condition()
    assert not condition.takes_commands
    with pytest.raises(AssertionError, match=sentence):
        raise AssertionError(condition.failure)
    others = {drive.state for drive in rig.drives.drives if DriveFault.LOST not in drive.faults}
    assert others == {PowerState.DISABLED}
    rig.close()


def test_a_fault_code_stops_all_is_named_and_is_left_when_it_is_acknowledged() -> None:
    rig = opened()
    frames = rig.drives.drives[1].fail(0x4310)
    assert frames == [Frame(0x82, b"\x10\x43\x01" + bytes(5))]
    state = hold(rig)
    assert rig.backend.condition().failure == "node 2 (A2): fault 0x4310 (power stage too hot)"
    assert set(state.drive_states) == {DriveState.OFF}
    before = rig.true_position_rad()
    hold(rig, 100)
    assert rig.backend.condition().failure
    rig.backend.resume()
    rig.get_ready()
    assert rig.true_position_rad() == before
    assert set(rig.backend.read().drive_states) == {DriveState.ACTIVE}
    rig.close()


def test_an_emergency_message_alone_is_a_failure_and_its_end_is_none() -> None:
    rig = opened()
    backend = rig.backend
    assert isinstance(backend, Can402Backend)
    assert backend._take(Frame(0x80 + 6, bytes(8))) == ""
    assert (
        backend._take(Frame(0x80 + 6, b"\x05\x73" + bytes(6)))
        == "node 6 (A6): fault 0x7305 (incremental encoder 1 failed)"
    )
    rig.close()


def test_a_drive_that_boots_anew_is_set_up_again_when_it_is_acknowledged() -> None:
    rig = opened()
    backend = rig.backend
    assert isinstance(backend, Can402Backend)
    for frame in rig.drives.drives[0].boot():
        assert backend._take(frame) == ""
    hold(rig, 2)
    assert backend.condition().failure == "node 1 (A1) is booted anew"
    hold(rig)
    backend.resume()
    rig.get_ready()
    assert {drive.state for drive in rig.drives.drives} == {PowerState.ENABLED}
    rig.close()


def test_a_bus_that_goes_off_is_a_failure_and_nothing_raises() -> None:
    rig = opened()
    rig.drives.bus_off = True
    for _ in range(3):
        rig.cycle(JointCommand(ROBOT.initial_position_rad, STILL))
    assert rig.backend.condition().failure == BUS_OFF
    rig.backend.resume()
    rig.cycle()
    assert "bus-off" in rig.backend.condition().failure
    rig.close()


def test_drives_without_heartbeat_are_guarded() -> None:
    rig = SimulatedDrivesRig(ROBOT)
    rig.open(period_ns=CYCLE_NS)
    rig.drives.drives[2].faults.add(DriveFault.NO_HEARTBEAT)
    rig.backend.close()
    rig.open(period_ns=CYCLE_NS)
    backend = rig.backend
    assert isinstance(backend, Can402Backend)
    assert backend._nodes is not None
    assert backend._nodes.guarded == {2}
    rig.get_ready()
    hold(rig, 100)
    assert not backend.condition().failure
    rig.drives.drives[2]._nmt = 127  # it exchanges nothing any more
    hold(rig, 30)
    assert backend.condition().failure == "node 3 (A3) is lost: no answer to the last 3 SYNCs"
    rig.close()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (DriveFault.LOST, r"node 4 \(A4\) does not answer \(object 1000h:0\) within 0.3 s: is it there, powered"),
        (DriveFault.NO_402, r"node 4 \(A4\) is no CiA 402 drive: its device type \(1000h\) is 0x00020191"),
        (
            DriveFault.IDENTITY,
            r"node 4 \(A4\) is another drive than the EDS file describes: its product code \(1018h\)",
        ),
    ],
)
def test_a_wrong_drive_is_refused_before_anything_moves(fault: DriveFault, sentence: str) -> None:
    rig = SimulatedDrivesRig(ROBOT)
    rig.open(period_ns=CYCLE_NS)
    rig.backend.close()
    rig.drives.drives[3].faults.add(fault)
    rig.drives.drives[3].boot()
    for _ in range(2):
        with pytest.raises(BackendError, match=sentence):
            rig.open(period_ns=CYCLE_NS)
    with pytest.raises(BackendError, match="not open"):
        rig.backend.read()
    rig.close()


def test_a_drive_that_is_never_enabled_is_named_with_its_state() -> None:
    rig = SimulatedDrivesRig(ROBOT, Can402Options(simulated=True, enable_timeout_s=0.1))
    rig.open(period_ns=CYCLE_NS)
    rig.drives.drives[6].faults.add(DriveFault.STUCK)
    hold(rig, 40)
    assert rig.backend.condition().failure == "node 7 (A7) is not enabled after 0.1 s: it is switch on disabled"
    rig.close()


def test_a_bus_that_does_not_open_is_one_sentence() -> None:
    backend = Can402Backend(parse_options({"channel": "nocan7"}), start_rad=ROBOT.initial_position_rad)
    with pytest.raises(BackendError, match=r"^cannot open the CAN bus 'nocan7' of the interface 'socketcan': "):
        backend.open(period_ns=CYCLE_NS)
    with pytest.raises(BackendError, match="not open"):
        backend.step()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"nodes": [1, 2, 3]}, "nodes"),
        ({"nodes": [1, 2, 3, 4, 5, 6, 6]}, "node 6 is there twice"),
        ({"axis": [{}, {}]}, "2 axis tables; one for all, or one for each of the 7 axes"),
        ({"axis": {"sign": 2}}, "sign is 2; 1 or -1 is needed"),
        ({"bit_rate": 1}, "there is no 'bit_rate'; valid: interface"),
        ({"eds": "/nowhere.eds"}, "cannot read the EDS file /nowhere.eds"),
    ],
)
def test_options_that_cannot_be_are_refused(options: dict[str, object], sentence: str) -> None:
    def make() -> None:
        SimulatedDrivesRig(ROBOT, parse_options({"simulated": True, **options})).open(period_ns=CYCLE_NS)

    with pytest.raises(ConfigurationError) as refused:
        make()
    assert sentence in str(refused.value)


def test_an_eds_file_that_is_none_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "broken.eds"
    broken.write_text("[1000]\nnonsense")
    rig = SimulatedDrivesRig(ROBOT, Can402Options(simulated=True, eds=broken))
    with pytest.raises(ConfigurationError, match="is no EDS file that can be read"):
        rig.open(period_ns=CYCLE_NS)


def test_the_eds_file_describes_the_simulated_drives() -> None:
    import canopen

    dictionary = canopen.import_od(str(EDS))
    drive = SimulatedDrive(1)
    for (index, sub), value in drive._objects.items():
        variable = (
            dictionary[index] if sub == 0 and not hasattr(dictionary[index], "subindices") else dictionary[index][sub]
        )
        assert len(variable) // 8 == len(value), f"{index:04X}:{sub}"
    assert dictionary[objects.IDENTITY][1].default == 0xF61


def test_real_drives_are_told_as_such() -> None:
    assert PLUGIN.capabilities().moves_real_drives
    assert not PLUGIN.replays
    simulated = Can402Backend(Can402Options(simulated=True), start_rad=ROBOT.initial_position_rad)
    assert not simulated.capabilities.moves_real_drives


def drives_of(description: RobotDescription) -> Can402Backend:
    return Can402Backend(Can402Options(simulated=True), start_rad=description.initial_position_rad)


def test_an_application_moves_seven_drives_and_is_told_when_one_is_lost() -> None:
    bench = ServoBench(backend=drives_of, cycle_ms=4)  # type: ignore[arg-type]  # any backend will do
    drives = _drives_behind(bench.backend)
    bench.run(0.1)
    application = Application(bench, watchdog_ms=1000)
    application.join()
    start = bench.controller.arm.position_rad
    application.start(MotionKind.PTP, (0.8, *start[1:]))
    bench.run(0.4)
    assert bench.controller.arm.position_rad[0] > 0.02
    drives[3].faults.add(DriveFault.LOST)
    bench.run(0.3)
    assert bench.controller.stops[0].reason == "node 4 (A4) is lost: no answer to the last 3 SYNCs"
    rest = bench.controller.arm.position_rad
    bench.run(0.3)
    assert bench.controller.arm.position_rad == rest
    assert math.dist(rest, start) > 0.02
    bench.backend.close()


def _drives_behind(backend: object) -> list[SimulatedDrive]:
    assert isinstance(backend, Can402Backend)
    assert backend.simulated is not None
    return backend.simulated.drives
