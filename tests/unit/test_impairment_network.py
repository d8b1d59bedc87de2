"""The network with faults: the same for the same seed, nothing lost that no fault tells of, true to its figures."""

import itertools
import math
import random
from collections import Counter
from collections.abc import Callable
from statistics import fmean

import pytest

from hil.values.errors import UsageError
from transport.impairment import (
    AtPacket,
    BurstLoss,
    ClockSkew,
    Corrupt,
    Delay,
    Delivery,
    Direction,
    Distribution,
    Duplicate,
    Fault,
    FaultNeverFired,
    HalfOpen,
    Jitter,
    Loss,
    Network,
    PacketAction,
    PacketId,
    Rate,
    Reorder,
)

MS = 1_000_000
S = 1_000_000_000
THERE, BACK = Direction.TO_PEER, Direction.TO_CONTROLLER


def sent(
    faults: list[Fault], *, seed: int = 0, count: int = 1000, period_ns: int = MS, size: int = 40, both: bool = False
) -> tuple[Network, list[Delivery]]:
    """Send ``count`` datagrams, each of its own content, and return the network with all that left it."""
    network = Network(faults, seed=seed)
    left: list[Delivery] = []
    for index in range(count):
        now_ns = index * period_ns
        left += network.due(now_ns=now_ns)
        for direction in (THERE, BACK) if both else (THERE,):
            network.send(index.to_bytes(4, "little") + bytes(size - 4), direction, now_ns=now_ns)
    while (due_ns := network.next_due_ns()) is not None:
        left += network.due(now_ns=due_ns)
    return network, left


def numbers(left: list[Delivery]) -> list[int]:
    return [delivery.packet.number for delivery in left]


def lost(count: int, left: list[Delivery]) -> list[int]:
    return sorted(set(range(count)) - set(numbers(left)))


def fired(network: Network) -> list[int]:
    return [report.fired for report in network.reports()]


def some_faults(rng: random.Random) -> list[Fault]:
    """Any faults in any order, several of a kind among them."""
    directions = [None, *Direction]
    makes: list[Callable[[Direction | None], Fault]] = [
        lambda way: Loss(rng.uniform(0.01, 0.3), way),
        lambda way: BurstLoss(rng.uniform(0.01, 0.3), rng.uniform(1.0, 9.0), way),
        lambda way: Delay(rng.randint(1, 9 * MS), way),
        lambda way: Jitter(rng.randint(1, 5 * MS), rng.choice(list(Distribution)), rng.random() < 0.5, way),
        lambda way: Reorder(rng.uniform(0.01, 0.5), rng.randint(1, 5), None, way),
        lambda way: Reorder(rng.uniform(0.01, 0.5), by_ns=rng.randint(1, 9 * MS), direction=way),
        lambda way: Duplicate(rng.uniform(0.01, 0.5), rng.randint(0, 3 * MS), way),
        lambda way: Corrupt(rng.uniform(0.01, 0.5), rng.randint(1, 9), way),
        lambda way: Rate(rng.randint(100_000, 1_000_000), rng.randint(100, 5_000), way),
        lambda way: HalfOpen(way or THERE, rng.randint(0, 100 * MS), rng.choice([None, 150 * MS])),
        lambda way: ClockSkew(rng.choice([-500.0, 500.0]), rng.randint(1, 5 * MS), way),
        lambda way: AtPacket(PacketAction.DROP, rng.randint(0, 300), way),
        lambda way: AtPacket(PacketAction.DELAY, rng.randint(0, 300), way, 7 * MS),
        lambda way: AtPacket(PacketAction.DUPLICATE, rng.randint(0, 300), way),
        lambda way: AtPacket(PacketAction.CORRUPT, rng.randint(0, 300), way),
    ]
    return [rng.choice(makes)(rng.choice(directions)) for _ in range(rng.randint(1, 6))]


@pytest.mark.parametrize("case", range(60))
def test_the_laws_of_any_network(case: int) -> None:
    faults = some_faults(random.Random(case))
    network, left = sent(faults, seed=case, count=250, both=True)
    again, left_again = sent(faults, seed=case, count=250, both=True)
    assert left == left_again, faults
    assert network.reports() == again.reports()
    reports = network.reports()
    assert len(left) == 500 - sum(report.lost for report in reports) + sum(report.added for report in reports), faults
    assert network.on_the_way == 0
    assert dict(network.packets) == {THERE: 250, BACK: 250}
    assert [delivery.at_ns for delivery in left] == sorted(delivery.at_ns for delivery in left)
    assert all(delivery.at_ns >= delivery.packet.number * MS for delivery in left)
    assert all(delivery.direction is delivery.packet.direction for delivery in left)
    for report in reports:
        assert report.lost <= report.fired <= report.met <= 500
        assert len(report.packets) == min(report.fired, 16)
        assert report.fault.direction in {None, *(packet.direction for packet in report.packets)} or not report.fired


@pytest.mark.parametrize("case", range(20))
def test_what_keeps_the_order_keeps_it(case: int) -> None:
    rng = random.Random(case)
    distribution = rng.choice(list(Distribution))
    faults: list[Fault] = [
        Jitter(3 * MS, distribution),
        Rate(400_000),
        Delay(2 * MS),
        ClockSkew(rng.choice([300.0, -300.0])),
        Loss(0.1),
    ]
    rng.shuffle(faults)
    _, left = sent(faults, seed=case)
    assert numbers(left) == sorted(numbers(left))


def test_another_seed_is_another_network_and_a_seed_stays_what_it_was() -> None:
    by_seed = [lost(1000, sent([Loss(0.02)], seed=seed)[1]) for seed in (7, 7, 8)]
    assert by_seed[0] == by_seed[1] != by_seed[2]
    assert by_seed[0][:6] == [78, 131, 188, 245, 298, 381]


def test_the_order_of_kinds_and_faults_beside_it_change_no_draw() -> None:
    faults: list[Fault] = [Loss(0.1), Delay(2 * MS), Jitter(MS), Corrupt(0.1), Duplicate(0.1)]
    assert sent(faults)[1] == sent(faults[::-1])[1]
    alone = lost(1000, sent([Loss(0.1)])[1])
    assert lost(1000, sent([*faults[1:], faults[0], Reorder(0.1)])[1]) == alone


def test_the_two_directions_and_two_of_a_kind_draw_for_themselves() -> None:
    _, left = sent([Loss(0.5)], both=True)
    by_way = [[one.packet.number for one in left if one.direction is way] for way in (THERE, BACK)]
    assert by_way[0] != by_way[1]
    network, left = sent([Loss(0.5), Loss(0.5)], count=4000)
    assert 850 < len(left) < 1150
    assert [report.met for report in network.reports()] == [4000, 4000 - network.reports()[0].lost]


def test_a_fault_of_one_direction_leaves_the_other_alone() -> None:
    network, left = sent([Loss(1.0, THERE), Delay(MS, BACK)], both=True)
    assert {one.direction for one in left} == {BACK}
    assert fired(network) == [1000, 1000]


@pytest.mark.parametrize("share", [0.01, 0.2, 0.9])
def test_as_much_is_lost_as_was_told(share: float) -> None:
    count = 20_000
    network, left = sent([Loss(share)], seed=1, count=count)
    sigma = math.sqrt(count * share * (1.0 - share))
    assert abs(count - len(left) - count * share) < 4.5 * sigma
    assert network.reports()[0].lost == count - len(left)


@pytest.mark.parametrize(("share", "mean"), [(0.02, 8.0), (0.3, 3.0), (0.5, 1.0)])
def test_bursts_are_as_long_and_as_many_as_was_told(share: float, mean: float) -> None:
    count = 60_000
    _, left = sent([BurstLoss(share, mean)], seed=2, count=count)
    gone = lost(count, left)
    lengths = [len(list(run)) for _, run in itertools.groupby(enumerate(gone), lambda pair: pair[1] - pair[0])]
    # Of a geometric distribution the deviation is sqrt(mean^2 - mean); bursts follow on each other independently.
    assert abs(fmean(lengths) - mean) <= 4.5 * math.sqrt(mean * (mean - 1.0) / len(lengths)) + 1e-9
    assert abs(len(gone) / count - share) < 4.5 * math.sqrt(2.0 * mean * share / count)
    fault = BurstLoss(share, mean)
    again = BurstLoss.of_probabilities(enter=fault.enter, leave=fault.leave)
    assert (again.share, again.mean_packets) == pytest.approx((share, mean))


@pytest.mark.parametrize(
    ("distribution", "mean", "median", "most"),
    [
        (Distribution.UNIFORM, 0.5, 0.5, 1.0),
        (Distribution.NORMAL, math.sqrt(2.0 / math.pi), 0.6745, 6.0),
        (Distribution.EXPONENTIAL, 1.0, math.log(2.0), 20.0),
    ],
)
def test_jitter_is_spread_as_its_distribution_says(
    distribution: Distribution, mean: float, median: float, most: float
) -> None:
    _, left = sent([Jitter(MS, distribution, overtaking=True)], seed=3, count=20_000)
    delays = sorted((one.at_ns - one.packet.number * MS) / MS for one in left)
    assert fmean(delays) == pytest.approx(mean, abs=0.035)
    assert delays[len(delays) // 2] == pytest.approx(median, abs=0.035)
    assert delays[0] >= 0.0
    assert delays[-1] <= most
    assert (numbers(left) == sorted(numbers(left))) is (distribution is Distribution.UNIFORM)


def test_jitter_of_a_queue_makes_the_next_wait() -> None:
    _, left = sent([Jitter(5 * MS)], seed=3)
    free = {one.packet.number: one.at_ns for one in sent([Jitter(5 * MS, overtaking=True)], seed=3)[1]}
    expected = list(itertools.accumulate((free[number] for number in range(1000)), max))
    assert [one.at_ns for one in left] == expected


def test_a_rate_spaces_datagrams_and_its_queue_overflows_exactly() -> None:
    fault = Rate(bits_per_s=1_000_000, queue_bytes=1000)
    network = Network([fault])
    for _ in range(20):
        network.send(bytes(72), THERE, now_ns=5)
    # With its headers a datagram has 100 bytes, 0.8 ms; ten of them are 1000 bytes.
    left = network.due(now_ns=S)
    assert [one.at_ns for one in left] == [5 + 800_000 * (index + 1) for index in range(10)]
    assert numbers(left) == list(range(10))
    (report,) = network.reports()
    assert (report.fired, report.lost) == (19, 10)
    network.send(bytes(3000), THERE, now_ns=S)
    assert [one.at_ns for one in network.due(now_ns=2 * S)] == [S + 3028 * 8_000], "an idle line takes any"


def test_a_rate_that_is_never_reached_does_not_fire() -> None:
    network, left = sent([Rate(10_000_000)], size=100)
    assert fired(network) == [0]
    assert all(one.at_ns - one.packet.number * MS == 102_400 for one in left)
    with pytest.raises(FaultNeverFired, match="rate=10Mbit/64kB"):
        network.require_fired()


@pytest.mark.parametrize("bits", [1, 2, 17])
def test_exactly_as_many_bits_are_flipped_as_was_told(bits: int) -> None:
    network, left = sent([Corrupt(0.3, bits)], seed=bits)
    flips = []
    for one in left:
        original = one.packet.number.to_bytes(4, "little") + bytes(36)
        flips.append(sum((a ^ b).bit_count() for a, b in zip(one.datagram, original, strict=True)))
    assert Counter(flips) == {0: 1000 - fired(network)[0], bits: fired(network)[0]}
    assert 230 < fired(network)[0] < 370


def test_a_short_datagram_is_inverted_and_an_empty_one_spared() -> None:
    network = Network([Corrupt(1.0, 99)])
    network.send(b"\x0f\xf0", THERE, now_ns=0)
    network.send(b"", THERE, now_ns=0)
    assert [one.datagram for one in network.due(now_ns=0)] == [b"\xf0\x0f", b""]
    assert fired(network) == [1]


def test_every_bit_may_be_hit() -> None:
    network = Network([Corrupt(1.0)])
    seen = set()
    for index in range(400):
        network.send(bytes(3), THERE, now_ns=index)
        seen |= {one.datagram for one in network.due(now_ns=index)}
    assert len(seen) == 24


def test_a_duplicate_comes_after_its_original() -> None:
    network, left = sent([Duplicate(0.2, 5 * MS), Delay(MS)], seed=4)
    times: dict[int, list[int]] = {}
    for one in left:
        times.setdefault(one.packet.number, []).append(one.at_ns - one.packet.number * MS)
    assert set(map(tuple, times.values())) == {(MS,), (MS, 6 * MS)}
    assert sum(len(pair) == 2 for pair in times.values()) == network.reports()[0].added
    assert 140 < network.reports()[0].added < 260


@pytest.mark.parametrize("by", [1, 2, 7])
def test_a_reordered_datagram_is_overtaken_by_exactly_as_many(by: int) -> None:
    network, left = sent([Reorder(0.02, by)], seed=5, count=2000)
    place = {number: index for index, number in enumerate(numbers(left))}
    overtakers = [
        sum(place[later] < place[one] for later in range(one + 1, min(one + 40, 2000))) for one in range(2000)
    ]
    held = [one for one in range(2000) if overtakers[one]]
    assert len(held) == fired(network)[0] > 20
    # Close to the end there are not enough that could overtake.
    assert {overtakers[one] for one in held if one < 1950} == {by}
    assert [packet.number for packet in network.reports()[0].first] == held[:8]


def test_reordering_by_time_lets_pass_what_comes_in_that_time() -> None:
    network, left = sent([Reorder(0.01, by_ns=2 * MS + 1)], seed=1)
    late = [one for one in left if one.at_ns != one.packet.number * MS]
    assert fired(network) == [len(late)] != [0]
    assert all(one.at_ns == one.packet.number * MS + 2 * MS + 1 for one in late)


def test_one_that_nobody_overtakes_goes_on_and_counts_for_nothing() -> None:
    network = Network([Reorder(1.0, 3), Reorder(1.0, by_ns=MS, direction=BACK)])
    network.send(b"alone", THERE, now_ns=0)
    assert network.due(now_ns=S - 1) == []
    assert [one.at_ns for one in network.due(now_ns=S)] == [S]
    assert fired(network) == [0, 0]


def test_reordering_stops_where_the_datagrams_do() -> None:
    faults: list[Fault] = [Reorder(0.5, 2)]
    network = Network(faults, seed=11)
    for index in range(4):
        network.send(bytes([index]), THERE, now_ns=index)
    assert len(network.due(now_ns=2 * S)) == 4


def test_half_open_kills_one_direction_for_its_time() -> None:
    network, left = sent([HalfOpen(BACK, 100 * MS, 300 * MS)], both=True)
    by_way = {way: {one.packet.number for one in left if one.direction is way} for way in Direction}
    assert by_way[THERE] == set(range(1000))
    assert set(range(1000)) - by_way[BACK] == set(range(100, 300))
    assert network.reports()[0].lost == 200
    assert len(sent([HalfOpen(THERE, 400 * MS)])[1]) == 400


@pytest.mark.parametrize("ppm", [200.0, -200.0])
def test_a_skewed_clock_shifts_both_ways_and_leaves_the_round_trip(ppm: float) -> None:
    _, left = sent([ClockSkew(ppm, 5 * MS)], count=3000, period_ns=10 * MS, both=True)
    delays: dict[Direction, dict[int, int]] = {THERE: {}, BACK: {}}
    for one in left:
        delays[one.direction][one.packet.number] = one.at_ns - one.packet.number * 10 * MS
    grows, shrinks = (THERE, BACK) if ppm > 0 else (BACK, THERE)
    for number in range(3000):
        shift_ns = number * 10 * MS * 200 // 1_000_000
        assert delays[grows][number] == shift_ns
        assert delays[shrinks][number] == max(0, 5 * MS - shift_ns)
    assert delays[THERE][1000] + delays[BACK][1000] == 5 * MS


def test_a_skew_counts_from_the_first_datagram() -> None:
    network = Network([ClockSkew(1000.0, direction=THERE)])
    for now_ns in (50 * S, 51 * S):
        network.send(b"x", THERE, now_ns=now_ns)
    assert [one.at_ns for one in network.due(now_ns=60 * S)] == [50 * S, 51 * S + MS]


@pytest.mark.parametrize("index", [0, 3, 9])
def test_a_single_packet(index: int) -> None:
    network, left = sent([AtPacket("drop", index)], count=10)
    assert lost(10, left) == [index]
    assert network.reports()[0].packets == (PacketId(THERE, index),)
    _, left = sent([AtPacket("delay", index, delay_ns=3 * MS + 1)], count=20)
    assert [one.packet.number for one in left if one.at_ns != one.packet.number * MS] == [index]
    assert numbers(left).index(index) == index + 3
    _, left = sent([AtPacket("duplicate", index)], count=10)
    assert numbers(left) == sorted([*range(10), index])
    _, left = sent([AtPacket("corrupt", index, bit=39)], count=10)
    clear = sent([Delay(1)], count=10)[1]
    changed = [one for one, other in zip(left, clear, strict=True) if one.datagram != other.datagram]
    assert numbers(changed) == [index]
    assert changed[0].datagram == index.to_bytes(4, "little") + b"\x80" + bytes(35)


def test_a_bit_beyond_the_end_is_counted_from_the_front_again() -> None:
    network = Network([AtPacket(PacketAction.CORRUPT, 0, bit=17)])
    network.send(bytes(2), THERE, now_ns=0)
    assert network.due(now_ns=0)[0].datagram == b"\x02\x00"


def test_a_packet_that_was_lost_before_does_not_count_as_hit() -> None:
    network, _ = sent([Loss(1.0), AtPacket("corrupt", 5)])
    with pytest.raises(FaultNeverFired, match="packet=corrupt@5") as caught:
        network.require_fired()
    assert caught.value.faults == (AtPacket("corrupt", 5),)


def test_faults_that_never_fired_are_named_with_what_passed() -> None:
    network, _ = sent([AtPacket("drop", 5), AtPacket("drop", 1000, THERE), HalfOpen(THERE, S)], both=True)
    with pytest.raises(FaultNeverFired) as caught:
        network.require_fired()
    assert str(caught.value) == (
        "never fired: packet=drop@1000:to-peer, half-open=to-peer@1s..; "
        "packets that entered: 1000 to-controller, 1000 to-peer"
    )
    sent([AtPacket("drop", 999, THERE)])[0].require_fired()


def test_a_report_in_words_and_numbers() -> None:
    faults: list[Fault] = [AtPacket("drop", 3), Delay(MS, THERE), Duplicate(1.0, direction=BACK), Loss(1.0, BACK)]
    network, _ = sent(faults, both=True)
    ends = "0, 1, 2, 4, 5, 6, 7, 8 ... 992, 993, 994, 995, 996, 997, 998, 999"
    assert [str(report) for report in network.reports()] == [
        "packet=drop@3: fired on 2 of 2000 packets, 2 lost: to-controller 3; to-peer 3",
        f"delay=1ms:to-peer: fired on 999 of 999 packets: to-peer {ends}",
        "duplicate=100%:to-controller: never fired, 0 packets met it",
        f"loss=100%:to-controller: fired on 999 of 999 packets, 999 lost: to-controller {ends}",
    ]


def test_what_is_too_much_on_the_way_is_lost_and_told() -> None:
    network = Network([Delay(S)], most_bytes_on_the_way=10_000)
    for index in range(100):
        network.send(bytes(50), THERE, now_ns=index)
    assert network.on_the_way == 40
    delay, full = network.reports()
    assert (delay.fired, full.fired, full.lost) == (100, 60, 60)
    assert str(full).startswith("more than 10kB on the way: fired on 60 of")
    assert len(network.due(now_ns=2 * S)) == 40
    network.send(bytes(50), THERE, now_ns=2 * S)
    assert network.on_the_way == 1
    network.require_fired()


def test_time_must_not_go_back() -> None:
    network = Network([])
    network.send(b"", THERE, now_ns=10)
    network.send(b"", BACK, now_ns=5)
    with pytest.raises(UsageError, match="enters to-peer at 9 ns, before the last at 10 ns"):
        network.send(b"", THERE, now_ns=9)
    assert network.packets[THERE] == 1


def test_without_faults_all_passes_at_once_with_its_route() -> None:
    network = Network([])
    assert network.next_due_ns() is None
    network.send(b"x", THERE, now_ns=3, route="somewhere")
    assert network.next_due_ns() == 3
    assert network.due(now_ns=2) == []
    assert network.due(now_ns=3) == [Delivery(3, THERE, b"x", PacketId(THERE, 0), "somewhere")]
    network.require_fired()
