"""Seven simulated drives on python-can's virtual bus: tables, figures, and every failure by its sentence."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backends.can402 import PLUGIN, objects
from backends.can402.backend import Can402Backend
from backends.can402.bus_load import MOST_LOAD, bus_load, check_bus_load
from backends.can402.drive import Drive
from backends.can402.options import AxisOptions, Can402Options, parse_options
from backends.can402.scaling import AxisScale
from backends.can402.simulated import EDS, DriveFault, SimulatedDrive
from backends.can402.state_machine import (
    DISABLE_VOLTAGE,
    ENABLE,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    TO_ENABLED,
    TO_OFF,
    PowerState,
    power_state,
)
from backends.can402.wire import MOST_ERROR_FRAMES, BusFailed, Frame, Wire, open_wire
from backends.rig import STILL
from backends.robots import load_description
from hil.values.arm import ArmState, JointCommand, seven
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import DriveState
from hil.values.motion import MotionKind
from hil.values.operator import PadKey, StopCategory
from hil.values.robot import RobotDescription, Seven
from tests.support.cases import cases
from tests.support.servo_virtual import Application, ServoBench
from tools.conformance.simulated_drives import SimulatedDrivesRig

DESCRIPTION = load_description("lbr-iiwa-14-r820")
PERIOD_NS = 4_000_000
A3 = 2


@pytest.fixture
def rig() -> Iterator[SimulatedDrivesRig]:
    made = SimulatedDrivesRig(DESCRIPTION)
    yield made
    made.close()


def ready(rig: SimulatedDrivesRig) -> Seven:
    rig.open(period_ns=PERIOD_NS)
    return rig.get_ready().position_rad


def cycles(rig: SimulatedDrivesRig, number: int, position: Seven | None = None) -> ArmState:
    state = rig.backend.read()
    for _ in range(number):
        state = rig.cycle(None if position is None else JointCommand(position, STILL))
    return state


def moving(rig: SimulatedDrivesRig, number: int = 50) -> Seven:
    told = start = ready(rig)
    for step in range(1, number + 1):
        told = seven([value + 0.001 * step for value in start])
        rig.cycle(JointCommand(told, (0.25,) * 7))
    return told


def failing_drives(rig: SimulatedDrivesRig, *faults: DriveFault, place: int = A3) -> SimulatedDrive:
    """Have drives that fail from before they are opened."""
    rig.open(period_ns=PERIOD_NS)
    rig.backend.close()
    drive = rig.drives.drives[place]
    drive.faults |= set(faults)
    drive.boot()
    return drive


def failure_when_opened(rig: SimulatedDrivesRig, *faults: DriveFault) -> str:
    failing_drives(rig, *faults)
    with pytest.raises(BackendError) as caught:
        rig.open(period_ns=PERIOD_NS)
    with pytest.raises(BackendError, match="not open"):
        rig.backend.read()
    return str(caught.value)


# --- tables


@pytest.mark.parametrize(
    ("word", "state", "on", "off"),
    [
        (0x0200, PowerState.NOT_READY, DISABLE_VOLTAGE, DISABLE_VOLTAGE),
        (0x0250, PowerState.DISABLED, SHUTDOWN, DISABLE_VOLTAGE),
        (0x0231, PowerState.READY, SWITCH_ON, DISABLE_VOLTAGE),
        (0x1233, PowerState.SWITCHED_ON, ENABLE, DISABLE_VOLTAGE),
        (0x1637, PowerState.ENABLED, ENABLE, QUICK_STOP),
        (0x0617, PowerState.QUICK_STOP, DISABLE_VOLTAGE, QUICK_STOP),
        (0x021F, PowerState.FAULT_REACTION, DISABLE_VOLTAGE, DISABLE_VOLTAGE),
        (0x0218, PowerState.FAULT, DISABLE_VOLTAGE, DISABLE_VOLTAGE),
        (0x0204, PowerState.UNKNOWN, DISABLE_VOLTAGE, DISABLE_VOLTAGE),
    ],
)
def test_each_state_and_what_leads_on_from_it(word: int, state: PowerState, on: int, off: int) -> None:
    """Status words as drives send them, with bits set that the state does not depend on (CiA 402-2, table 30)."""
    assert power_state(word) is state
    assert (TO_ENABLED[state], TO_OFF[state]) == (on, off)


def test_every_status_word_is_one_state_whatever_its_other_bits() -> None:
    for word in range(1 << 16):
        assert power_state(word) is power_state(word & 0x6F | 0x10)


@settings(max_examples=cases(50))
@given(
    counts_per_turn=st.integers(1, 1 << 24),
    gear=st.floats(0.1, 200.0),
    sign=st.sampled_from([1, -1]),
    offset_rad=st.floats(-math.tau, math.tau),
    position_rad=st.floats(-3.2, 3.2),
)
def test_counts_and_back(counts_per_turn: int, gear: float, sign: int, offset_rad: float, position_rad: float) -> None:
    scale = AxisScale(AxisOptions(counts_per_turn=counts_per_turn, gear=gear, sign=sign, offset_rad=offset_rad))
    if scale.reaches(position_rad):
        back = scale.position_rad(scale.counts(position_rad))
        assert abs(back - position_rad) <= 0.5 / abs(scale.counts_per_rad) + 1e-9
        assert scale.counts(back) == scale.counts(position_rad)
    else:
        assert abs(scale.counts(position_rad)) == (1 << 31) - 1


def test_a_scale_by_hand() -> None:
    """4096 counts, gear 50, against the axis: 204800 counts a turn."""
    scale = AxisScale(AxisOptions(counts_per_turn=4096, gear=50.0, sign=-1, offset_rad=0.5, rated_torque_nm=40.0))
    assert scale.counts(0.5) == 0
    assert scale.counts(0.5 + math.pi) == -102_400
    assert scale.velocity_rad_s(-204_800) == pytest.approx(math.tau)
    assert scale.motor_torque_nm(-250) == pytest.approx(10.0)


# --- the bus


def test_the_load_of_a_cycle_by_hand() -> None:
    """SYNC, and for seven drives a command of 6 bytes, an answer of 6 and one of 8: 55 + 7 (115 + 115 + 135)."""
    load = bus_load(bitrate=1_000_000, period_ns=PERIOD_NS)
    assert (load.frames, load.bits) == (22, 2610)
    assert load.share == pytest.approx(2610 / 4000)
    assert check_bus_load(bitrate=1_000_000, period_ns=PERIOD_NS) == load


@pytest.mark.parametrize(
    ("bitrate", "period_ms", "sentence"),
    [
        (500_000, 4, "130 % of the bus at 500 kbit/s, 90 % are allowed; what would fit: 800 kbit/s"),
        (1_000_000, 1, "261 % of the bus at 1000 kbit/s, 90 % are allowed; what would fit: 4 ms"),
        (125_000, 5, "418 % of the bus at 125 kbit/s, 90 % are allowed; what would fit: 800 kbit/s"),
    ],
)
def test_a_cycle_the_bus_does_not_hold_is_refused_with_the_figure(bitrate: int, period_ms: int, sentence: str) -> None:
    backend = Can402Backend(parse_options({"simulated": True, "bitrate": bitrate}), start_rad=STILL)
    with pytest.raises(ConfigurationError) as caught:
        backend.open(period_ns=period_ms * 1_000_000)
    assert str(caught.value) == f"7 drives need 22 frames of 2610 bits in a cycle of {period_ms} ms: {sentence}"
    assert backend.simulated is None, "nothing was opened"
    assert MOST_LOAD == 0.9


class Script(can.BusABC):  # type: ignore[misc]  # python-can is not looked into
    """A bus that gives what it was told to, and fails when it was told to."""

    def __init__(self, *messages: can.Message | Exception, state: can.BusState = can.BusState.ACTIVE) -> None:
        super().__init__(channel="script")
        self._messages = list(messages)
        self._told = state

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            return None, False
        message = self._messages.pop(0)
        if isinstance(message, Exception):
            raise message
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("transmit buffer full")

    @property
    def state(self) -> can.BusState:
        return self._told


def error_frame(kind: int = 0x8) -> can.Message:
    return can.Message(arbitration_id=kind, is_error_frame=True, is_extended_id=False)


def test_bus_off_is_told_by_state_and_by_error_frame() -> None:
    for wire in (Wire(Script(error_frame(0x40))), Wire(Script(state=can.BusState.ERROR))):
        with pytest.raises(BusFailed, match=r"bus-off: .* look at cable, ends and bit rate"):  # noqa: PT012
            wire.receive()
            wire.check()
        wire.close()


def test_some_error_frames_are_borne_and_many_are_a_disturbed_bus() -> None:
    data = can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False)
    wire = Wire(Script(*[error_frame()] * MOST_ERROR_FRAMES, data, *[error_frame()] * (MOST_ERROR_FRAMES + 1)))
    assert wire.receive() == Frame(0x181, b"\1")
    wire.check()
    with pytest.raises(BusFailed, match="disturbed: 17 error frames"):
        wire.receive()
    wire.close()


def test_a_bus_that_takes_or_gives_nothing_is_named() -> None:
    wire = Wire(Script(can.CanOperationError("network is down")))
    with pytest.raises(BusFailed, match="takes no frames: transmit buffer full"):
        wire.send(Frame(0x80, b""))
    with pytest.raises(BusFailed, match="cannot be read: network is down"):
        wire.receive()
    for _ in range(2):
        wire.close()
    with pytest.raises(BusFailed, match="is closed"):
        wire.receive()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"interface": "nonsense"}, "cannot open the CAN bus 'can0' of the interface 'nonsense'"),
        ({"channel": "fri-hil-none"}, "cannot open the CAN bus 'fri-hil-none' of the interface 'socketcan'"),
    ],
)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_bus_that_does_not_open_is_named(options: dict[str, Any], sentence: str) -> None:
    backend = Can402Backend(parse_options(options), start_rad=STILL)
    with pytest.raises(BackendError, match=sentence):
        backend.open(period_ns=PERIOD_NS)
    assert open_wire.__doc__


# --- options


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"node": [1]}, "there is no 'node'; valid: interface, channel"),
        ({"nodes": [1, 2, 3, 4, 5, 6, 6]}, "node 6 is there twice"),
        ({"nodes": [1, 2, 3]}, "nodes: "),
        ({"nodes": [1, 2, 3, 4, 5, 6, 127]}, "less than or equal to 126, got 127"),
        ({"axis": [{}] * 3}, "3 axis tables; one for all, or one for each"),
        ({"axis": {"sign": 0}}, "sign is 0; 1 or -1 is needed"),
        ({"axis": {"gear": math.nan}}, "gear"),
        ({"bitrate": "fast"}, "bitrate: .* got 'fast'"),
        ({"simulated": 1}, "simulated: "),
    ],
)
def test_options_that_cannot_be(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        PLUGIN.check_options(options)


def test_every_option_has_its_help() -> None:
    assert set(PLUGIN.options_help) == set(Can402Options.model_fields)
    assert PLUGIN.capabilities().moves_real_drives


def test_an_axis_whose_turn_32_bits_do_not_hold_is_refused() -> None:
    backend = Can402Backend(parse_options({"simulated": True, "axis": {"gear": 9000.0}}), start_rad=STILL)
    with pytest.raises(ConfigurationError, match=r"node 1 \(A1\): .* counts_per_turn x gear is too much"):
        backend.open(period_ns=PERIOD_NS)


# --- work


def test_it_measures_in_the_sense_of_the_axis_whatever_the_sign_of_the_drive() -> None:
    axis = [{"sign": -1 if place % 2 else 1, "offset_rad": 0.1 * place} for place in range(7)]
    rig = SimulatedDrivesRig(DESCRIPTION, parse_options({"simulated": True, "axis": axis}))
    told = moving(rig)
    rig.cycle(JointCommand(seven([value + 0.001 for value in told]), (0.25,) * 7))
    state = rig.backend.read()
    assert state.velocity_rad_s == pytest.approx((0.25,) * 7, abs=1e-3)
    assert state.position_rad == pytest.approx(told, abs=1e-6)
    # It turns towards plus against friction: the motor pushes towards plus, and the sensors show minus that.
    assert max(state.torque_nm) < 0.0
    rig.close()


def test_a_drive_is_told_to_stay_where_it_is_until_it_is_enabled(rig: SimulatedDrivesRig) -> None:
    rig.open(period_ns=PERIOD_NS)
    before = [drive.counts for drive in rig.drives.drives]
    while not rig.backend.condition().takes_commands:
        assert "are being enabled: node" in rig.backend.condition().reason
        rig.cycle(JointCommand(seven([value + 0.1 for value in DESCRIPTION.initial_position_rad]), STILL))
    assert [drive.counts for drive in rig.drives.drives] == before
    assert [drive.state for drive in rig.drives.drives] == [PowerState.ENABLED] * 7


def test_closed_drives_hold_nothing_and_miss_nobody(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    cycles(rig, 50)
    rig.backend.close()
    for _ in range(500):
        assert not [frame for frame in rig.drives.passed(PERIOD_NS) if frame.identifier < objects.HEARTBEAT_COB], (
            "an emergency"
        )
    assert [drive.state for drive in rig.drives.drives] == [PowerState.DISABLED] * 7


def test_drives_that_miss_our_heartbeat_stop_by_themselves(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    for _ in range(100):
        rig.drives.passed(PERIOD_NS)
    assert {drive.error_code for drive in rig.drives.drives} == {0x8130}
    cycles(rig, 2)
    assert (
        rig.backend.condition().failure == "node 1 (A1): fault 0x8130 (it misses our heartbeat, or the node guarding)"
    )


def test_a_drive_without_a_heartbeat_is_guarded(rig: SimulatedDrivesRig) -> None:
    failing_drives(rig, DriveFault.NO_HEARTBEAT)
    ready(rig)
    cycles(rig, 200)
    assert rig.backend.condition().takes_commands
    rig.drives.drives[A3]._nmt = 4
    cycles(rig, 40)
    assert rig.backend.condition().failure.startswith("node 3 (A3) is ")


# --- failures


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (DriveFault.IDENTITY, "node 3 (A3) is another drive than the EDS file describes: its product code (1018h)"),
        (DriveFault.NO_402, "node 3 (A3) is no CiA 402 drive: its device type (1000h) is 0x00020191"),
        (DriveFault.LOST, "node 3 (A3) does not answer (object 1000h:0) within 0.3 s: is it there, powered"),
        (DriveFault.OTHER_SDO, "bit rate?; what came was an answer of node 4"),
    ],
)
def test_a_drive_that_cannot_be_is_named_before_anything_moves(
    rig: SimulatedDrivesRig, fault: DriveFault, sentence: str
) -> None:
    assert sentence in failure_when_opened(rig, fault)


def test_what_failed_to_open_opens_once_the_drive_is_right(rig: SimulatedDrivesRig) -> None:
    failure_when_opened(rig, DriveFault.IDENTITY)
    rig.drives.drives[A3].faults.clear()
    rig.drives.drives[A3].boot()
    ready(rig)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (DriveFault.LOST, "node 3 (A3) is lost: no answer to the last 3 SYNCs"),
        (
            DriveFault.OTHER_NODE,
            "node 4 (A4) answers more often than it is asked: two drives have the same node number",
        ),
        (DriveFault.STRANGER, "the bus carries process data of node 99, which is none of this station's (1, 2, 3,"),
    ],
)
def test_a_drive_that_fails_stops_all_of_them(rig: SimulatedDrivesRig, fault: DriveFault, sentence: str) -> None:
    moving(rig)
    rig.drives.drives[A3].faults.add(fault)
    cycles(rig, 12)
    condition = rig.backend.condition()
    assert condition.failure.startswith(sentence)
    assert not condition.takes_commands
    assert condition.reason == condition.failure
    others = [drive for drive in rig.drives.drives if fault not in drive.faults]
    assert [drive.state for drive in others] == [PowerState.DISABLED] * 6
    stood = [drive.counts for drive in others]
    cycles(rig, 100, seven([value + 0.05 for value in rig.true_position_rad()]))
    assert [drive.counts for drive in others] == stood
    assert rig.backend.condition() is condition


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x2310, "continuous over-current"), (0x3210, "over-voltage of the DC link"), (0x4310, "power stage too hot"),
        (0x7305, "incremental encoder 1"), (0x8611, "following error"), (0x7FFF, "motor or sensor"),
    ],
)  # fmt: skip
def test_a_fault_is_told_with_its_code_and_reset_when_somebody_says_so(
    rig: SimulatedDrivesRig, code: int, words: str
) -> None:
    moving(rig)
    # The emergency message is lost: the status word and the process data say it too.
    rig.drives.drives[A3].fail(code)
    state = cycles(rig, 12)
    assert rig.backend.condition().failure.startswith(f"node 3 (A3): fault 0x{code:04X} ({words}")
    assert set(state.drive_states) == {DriveState.OFF}
    cycles(rig, 100)
    assert rig.drives.drives[A3].state is PowerState.FAULT
    before = rig.true_position_rad()
    rig.backend.resume()
    assert not rig.backend.condition().failure
    rig.get_ready()
    assert rig.true_position_rad() == before


def test_a_fault_that_stays_is_counted(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    drive = rig.drives.drives[A3]
    for attempt in range(1, 3):
        drive.fail(0x4310)
        cycles(rig, 5)
        rig.backend.resume()
        assert not rig.backend.condition().failure
        for _ in range(126):
            drive.fail(0x4310)
            rig.cycle()
        told = f"node 3 (A3): fault 0x4310 (power stage too hot), still there after its reset number {attempt}"
        assert rig.backend.condition().failure == told


def test_a_drive_that_boots_anew_is_set_up_again_when_somebody_says_so(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    drive = rig.drives.drives[A3]
    wire = rig.drives.wire(period_ns=PERIOD_NS)
    for frame in drive.boot():
        wire.send(frame)
    cycles(rig, 10)
    assert rig.backend.condition().failure == "node 3 (A3) is booted anew"
    rig.backend.resume()
    rig.get_ready()
    assert drive.operational
    wire.close()


def test_a_silent_drive_is_not_waited_for_when_a_stop_is_acknowledged(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    rig.lose_peer()
    cycles(rig, 10)
    rig.backend.resume()
    assert rig.backend.condition().failure == "node 4 (A4) is lost: no answer to the last 10 SYNCs"


def test_bus_off_stops_and_nothing_is_acknowledged_before_the_bus_is_back(rig: SimulatedDrivesRig) -> None:
    moving(rig)
    rig.drives.bus_off = True
    cycles(rig, 3)
    failure = rig.backend.condition().failure
    assert failure.startswith("the CAN controller is bus-off")
    rig.backend.resume()
    assert rig.backend.condition().failure == failure
    rig.drives.bus_off = False
    cycles(rig, 3)
    rig.backend.resume()
    rig.get_ready()


def test_a_drive_that_leaves_operation_enabled_by_itself_is_a_failure(rig: SimulatedDrivesRig) -> None:
    ready(rig)
    rig.drives.drives[A3].state = PowerState.DISABLED
    cycles(rig, 3)
    cycles(rig, 10)
    told = "node 3 (A3) is switch on disabled, though nobody switched it off from here"
    assert rig.backend.condition().failure == told
    cycles(rig, 100)
    assert {drive.state for drive in rig.drives.drives} == {PowerState.DISABLED}


def test_an_answer_that_comes_late_is_no_second_drive() -> None:
    drive = Drive("node 1 (A1)", AxisScale(AxisOptions()), lost_after=3, heartbeat_ms=100)
    drive.began(0x27, 0)
    answer = struct.pack("<Hi", 0x27, 5)
    drive.synchronised()
    drive.count_silence(PERIOD_NS)
    drive.synchronised()
    for late in range(4):
        assert not drive.answer(0, answer), late
    assert "answers more often than it is asked" in drive.answer(0, answer)


@settings(max_examples=cases(50))
@given(data=st.binary(max_size=8), identifier=st.integers(0x081, 0x7FF))
def test_nothing_on_the_bus_raises(data: bytes, identifier: int) -> None:
    rig = _FUZZED[0] if _FUZZED else SimulatedDrivesRig(DESCRIPTION)
    if not _FUZZED:
        _FUZZED.append(rig)
        rig.open(period_ns=PERIOD_NS)
    backend = rig.backend
    assert isinstance(backend, Can402Backend)
    backend._take(Frame(identifier, data))
    rig.cycle()
    assert rig.backend.condition().reason or rig.backend.condition().takes_commands


_FUZZED: list[SimulatedDrivesRig] = []


@pytest.fixture(autouse=True, scope="module")
def _close_fuzzed() -> Iterator[None]:
    yield
    for rig in _FUZZED:
        rig.close()


# --- the EDS file


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("[607A]", "[207A]"), "describes no drive for this backend: it has no object 607Ah"),
        (("ParameterName=Target position\nObjectType=0x7", "ParameterName=\nObjectType=x"), "no EDS file"),
        (("DefaultValue=0x00000402", "DefaultValue=0x00000403"), "the file says 0x00000403"),
        (None, "cannot read the EDS file .*: No such file or directory"),
    ],
)
def test_a_wrong_eds_file_is_named(tmp_path: Path, change: tuple[str, str] | None, sentence: str) -> None:
    path = tmp_path / "drive.eds"
    if change is not None:
        assert change[0] in EDS.read_text()
        path.write_text(EDS.read_text().replace(*change))
    backend = Can402Backend(parse_options({"simulated": True, "eds": str(path)}), start_rad=STILL)
    with pytest.raises((ConfigurationError, BackendError), match=sentence):
        backend.open(period_ns=PERIOD_NS)


def test_the_eds_file_describes_the_simulated_drive() -> None:
    import canopen

    dictionary = canopen.import_od(str(EDS))
    drive = SimulatedDrive(1)
    assert {index for index in objects.NEEDED if index not in dictionary} == set()
    for index in set(objects.NEEDED) - {objects.CONTROL_WORD, objects.TARGET_POSITION}:  # process data only
        entry = dictionary[index]
        sub = 0 if isinstance(entry, canopen.objectdictionary.ODVariable) else 1
        variable = entry if sub == 0 else entry[sub]
        value = drive._value(index, sub)
        assert value is not None, f"{index:04X}h"
        assert len(value) * 8 == len(variable), f"{index:04X}h"


# --- under a controller


def drives_of(description: RobotDescription) -> Can402Backend:
    return Can402Backend(Can402Options(simulated=True), start_rad=description.initial_position_rad)


@pytest.fixture
def bench() -> Iterator[ServoBench]:
    made = ServoBench(backend=drives_of, cycle_ms=4)  # type: ignore[arg-type]  # any backend will do
    made.run(0.1)
    yield made
    made.backend.close()


def moving_application(bench: ServoBench) -> list[SimulatedDrive]:
    application = Application(bench, watchdog_ms=1000)
    application.join()
    start = bench.controller.arm.position_rad
    application.start(MotionKind.PTP, (start[0] + 0.8, *start[1:]))
    bench.run(0.4)
    assert bench.controller.arm.position_rad[0] > start[0] + 0.02
    backend: object = bench.backend
    assert isinstance(backend, Can402Backend)
    assert backend.simulated is not None
    return backend.simulated.drives


def test_the_stop_for_a_lost_drive_is_acknowledged_when_it_is_back_and_not_before(bench: ServoBench) -> None:
    lost = moving_application(bench)[3]
    lost.faults.add(DriveFault.LOST)
    bench.run(0.5)
    told = "node 4 (A4) is lost: no answer to the last "
    assert bench.controller.stops[0].reason == f"{told}3 SYNCs"
    [refused] = bench.press(PadKey.RESET)
    assert refused.startswith(f"the arm is not known to stand still yet: {told}")
    lost.faults.clear()
    bench.run(0.1)
    rest = bench.controller.arm.position_rad
    assert not bench.press(PadKey.RESET, PadKey.START)
    bench.run(0.2)
    assert set(bench.controller.arm.drive_states) == {DriveState.ACTIVE}
    assert bench.controller.arm.position_rad == pytest.approx(rest, abs=1e-5)
    bench.run(1.2)
    moving_application(bench)


def test_a_fault_code_under_way_stops_the_arm_and_a_reset_lets_it_move_again(bench: ServoBench) -> None:
    moving_application(bench)[1].fail(0x3210)
    bench.run(0.3)
    assert bench.controller.stops[0].reason == "node 2 (A2): fault 0x3210 (over-voltage of the DC link)"
    assert bench.controller.stops[0].category is StopCategory.DROP
    assert set(bench.controller.arm.drive_states) == {DriveState.OFF}
    assert not bench.press(PadKey.RESET, PadKey.START)
    bench.run(1.2)
    moving_application(bench)
