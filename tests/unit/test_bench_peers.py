"""What the comparison with peers makes of what it measured, and how it speaks to them."""

import json
import struct
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from hil.values.errors import ConfigurationError, EndpointError
from tools.bench.peers import franka_wire
from tools.bench.peers.compare import BARE, COMMANDS, LISTENS, LOOP, OURS, SIMULATORS, PeersReport, Simulator, steps
from tools.bench.peers.environment import FRANKA, FRANKY, environments
from tools.bench.peers.figures import Cycles, Quantiles, Stream, cycles_of, stream_of
from tools.bench.peers.sine import AMPLITUDE_RAD, AXIS, with_sine
from tools.bench.peers.table import DIFFERENCES, complaints, rows, spread

MS = 1_000_000


def seen(arrived_ns: list[int], counters: list[int] | None = None) -> dict[str, Any]:
    numbers = list(range(len(arrived_ns))) if counters is None else counters
    return {"arrived_ns": arrived_ns, "counters": numbers, "state_bytes": 388, "server_cores": 0.25, "moved_rad": 0.08}


def test_a_stream_in_its_period_has_its_rate_and_no_jitter() -> None:
    stream = stream_of(seen([5 * MS + number * MS for number in range(1001)]))
    assert (stream.states, stream.lost, stream.rate_hz, stream.late_percent) == (1001, 0, 1000.0, 0.0)
    assert stream.interval_us == Quantiles(1000.0, 1000.0, 1000.0, 1000.0)
    assert stream.jitter_us == Quantiles(0.0, 0.0, 0.0, 0.0)


def test_jitter_is_how_far_an_interval_is_from_a_millisecond_on_either_side() -> None:
    # Each second state 100 us late: the rate is right, and every interval is off by 100 us.
    stream = stream_of(seen([number * MS + (number % 2) * 100_000 for number in range(2001)]))
    assert stream.rate_hz == 1000.0
    assert stream.jitter_us == Quantiles(100.0, 100.0, 100.0, 100.0)
    assert stream.interval_us.max == 1100.0


def test_a_slow_clock_shows_in_the_rate_and_in_every_interval() -> None:
    stream = stream_of(seen([number * 1_100_000 for number in range(1001)]))
    assert stream.rate_hz == pytest.approx(909.091)
    assert stream.jitter_us.p50 == 100.0


def test_a_stall_is_in_the_tail_and_in_the_share_of_late_states() -> None:
    stream = stream_of(seen([number * MS + (7 * MS if number >= 50 else 0) for number in range(101)]))
    assert stream.interval_us.max == 8000.0
    assert stream.interval_us.p50 == 1000.0
    assert stream.late_percent == 1.0


def test_lost_states_are_the_numbers_that_did_not_come() -> None:
    assert stream_of(seen([0, MS, 4 * MS], [7, 8, 11])).lost == 2
    # FRI counters wrap around.
    assert stream_of(seen([0, MS, 2 * MS], [2**32 - 2, 2**32 - 1, 0])).lost == 0


def test_two_states_are_no_stream() -> None:
    with pytest.raises(EndpointError, match="at least 3"):
        stream_of(seen([0, MS]))


def test_virtual_time_is_by_the_mean_of_all_cycles_and_not_by_the_median() -> None:
    found = cycles_of([50_000] * 99 + [5_050_000])
    assert found.cost_us.p50 == 50.0
    assert found.cost_us.max == 5050.0
    assert found.virtual_time_factor == 10.0


def report(repeats: int, *, seconds: float = 5.0, moved_rad: float = 0.08) -> PeersReport:
    simulators = {}
    for name, slower in ((OURS, 1.0), (FRANKY, 3.0), (FRANKA, 2.0)):
        runs = range(repeats)
        cycles = [Cycles(Quantiles(40.0 * slower + run, 90.0, 95.0, 100.0), 20.0 / slower) for run in runs]
        stream = Stream(1000, 0, 1000.0 / slower, *(Quantiles(1.0, 2.0, 3.0, 4.0),) * 2, 0.5, 388, 0.25, moved_rad)
        simulators[name] = Simulator(
            {BARE: cycles, LOOP: [] if name == FRANKA else cycles},
            {LISTENS: [stream] * repeats, COMMANDS: [stream] * repeats},
        )
    return PeersReport(1000, seconds, repeats, {FRANKY: {"mujoco": "4.0.0"}}, simulators, (0.5, 0.4, 0.3))


def test_the_table_has_ours_beside_theirs() -> None:
    table = rows(report(repeats=3))
    headings = [row.label for row in table if not row.cells]
    assert len(headings) == 4
    first = table[1]
    assert first.label == "one cycle, p50 us"
    assert first.cells == ("41.0 (40.0 .. 42.0)", "121.0 (120.0 .. 122.0)", "81.0 (80.0 .. 82.0) *")
    [*_, listens, commands] = [row for row in table if row.label == "rate, Hz"]
    assert (
        listens.cells
        == commands.cells
        == ("1000.00 (1000.00 .. 1000.00)", "333.33 (333.33 .. 333.33)", "500.00 (500.00 .. 500.00)")
    )


def test_one_repeat_has_no_spread() -> None:
    assert spread([12.34], 1) == "12.3"
    assert rows(report(repeats=1))[1].cells == ("40.0", "120.0", "80.0 *")


def test_what_a_simulator_cannot_do_is_an_empty_cell_and_told_in_words() -> None:
    table = rows(report(repeats=1))
    with_sockets = [row.label for row in table].index("the same with sockets and a client over loopback")
    assert table[with_sockets + 1].cells == ("40.0", "120.0", "-")
    assert any(f"{FRANKA} serves in real time only" in sentence for sentence in DIFFERENCES)


def test_an_arm_that_did_not_follow_is_told() -> None:
    assert complaints(report(repeats=2)) == []
    told = complaints(report(repeats=2, moved_rad=0.0))
    assert [sentence.split(":")[0] for sentence in told] == [
        f"{name} followed its client in 0 of 2 runs" for name in SIMULATORS
    ]
    # In less than a period an arm that follows need not go far.
    assert complaints(report(repeats=1, seconds=3.0, moved_rad=0.0)) == [
        "The streams are shorter than a period of the sine: whether arms followed was not looked at."
    ]


def test_json_has_every_run() -> None:
    found = json.loads(json.dumps(report(repeats=2).as_dict()))
    assert found["simulators"][FRANKY]["cycles"][BARE][1]["cost_us"]["p50"] == 121.0
    assert len(found["simulators"][OURS]["streams"][COMMANDS]) == 2
    assert asdict(Quantiles(1.0, 2.0, 3.0, 4.0)) == found["simulators"][OURS]["streams"][LISTENS][0]["interval_us"]


def test_everything_is_measured_in_turn() -> None:
    assert steps(3) == 3 * 3 * len(SIMULATORS)


def test_without_its_environment_the_sentence_names_the_command_that_makes_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="make bench-peers"):
        environments(tmp_path)


def test_a_connect_request_is_framed_as_libfranka_frames_it() -> None:
    assert franka_wire.connect_request(0x1234) == bytes.fromhex("00000000 01000000 10000000 0a00 3412")


def test_a_move_request_says_its_whole_length() -> None:
    request = franka_wire.move_request(2)
    assert struct.unpack_from("<III", request) == (1, 2, len(request))
    assert len(request) == 12 + 8 + 48


def test_answers_are_taken_one_by_one_and_only_whole() -> None:
    first = struct.pack("<IIIB", 1, 2, 13, franka_wire.MOTION_STARTED)
    second = struct.pack("<IIIHH4x", 0, 1, 20, 0, 10)
    for cut in range(len(first)):
        assert franka_wire.read_answer(first[:cut]) is None
    assert franka_wire.read_answer(first + second) == (franka_wire.Answer(2, franka_wire.MOTION_STARTED), second)


def test_a_command_carries_the_position_where_the_robot_server_reads_it() -> None:
    position_rad = tuple(0.1 * joint for joint in range(7))
    command = franka_wire.position_command(42, position_rad)
    assert len(command) == 8 + 8 * (7 + 7 + 16 + 6 + 2) + 2 + 8 * 7 + 1
    assert struct.unpack_from("<Q7d", command) == (42, *position_rad)
    assert not any(command[8 + 8 * 7 :])


def test_an_answer_carries_the_number_of_its_state() -> None:
    # A simulator that keeps count of answers takes any other number for a lost cycle, and waits for the right one.
    state = struct.pack("<Q", 4711) + bytes(1369)
    assert franka_wire.state_counter(franka_wire.position_answer(state, (0.0,) * 7)) == 4711


def test_the_measured_position_is_found_in_a_state() -> None:
    before = 6 * 16 + (1 + 9 + 3) * 2 + 2 + 2 + 7 + 7 + 7
    values = [float(number) for number in range(before + 7)]
    state = struct.pack(f"<Q{len(values)}f", 1, *values)
    assert franka_wire.measured_position_rad(state) == tuple(values[before:])


def test_the_sine_moves_one_axis_from_where_the_arm_stands() -> None:
    start_rad = (0.1, 0.2, 0.3, -1.5, 0.5, 0.6, 0.7)
    assert with_sine(start_rad, 0) == start_rad
    quarter = with_sine(start_rad, 1000)
    assert quarter[AXIS] == pytest.approx(-1.5 + AMPLITUDE_RAD)
    assert [now for axis, now in enumerate(quarter) if axis != AXIS] == [0.1, 0.2, 0.3, 0.5, 0.6, 0.7]
