"""The split of the answers' time, and histograms that are fed each cycle."""

from hypothesis import given, settings
from hypothesis import strategies as st

from hil.core.diagnosis.answer_path import WORST, AnswerPath
from hil.core.settings import FriSettings
from hil.core.statistics import CycleHistogram, Histogram
from tests.support.cases import cases
from tests.support.virtual import PEER, SOURCE, Bench
from tools.doctor.capture.send_grid import SendGrid

MS = 1_000_000


@settings(max_examples=cases(25))
@given(st.lists(st.integers(-5, 2**61), max_size=100))
def test_a_cycle_histogram_counts_as_the_other_does_within_its_buckets(values: list[int]) -> None:
    fast, exact = CycleHistogram(), Histogram()
    for value in values:
        fast.add(value)
        exact.add(value)
    whole = fast.whole()
    assert whole.count == exact.count
    assert exact.maximum <= whole.maximum <= exact.maximum + 1023
    for fraction in (0.1, 0.5, 0.99, 1.0):
        found, wanted = whole.quantile(fraction), exact.quantile(fraction)
        assert (found is None) == (wanted is None)
        if found is not None and wanted is not None:
            assert abs(found - wanted) <= 1024 + wanted // 32


def test_an_answer_is_split_into_four_parts() -> None:
    path = AnswerPath(budget_ns=MS)
    path.began(0, 40_000)
    path.sent(7, 0, 40_000)
    path.departed_ns = 110_000
    path.arrived.append((400_000, 290_000, 7))
    path.began(MS, MS + 60_000)
    path.sent(8, MS, MS + 60_000)
    (worst,) = path.worst
    assert (worst.counter, worst.send_lateness_ns, worst.age_ns) == (7, 110_000, 290_000)
    assert (worst.wait_ns, worst.use_lateness_ns, worst.cycle) == (600_000, 60_000, 1)
    largest = {name: part.maximum // 1024 for name, part in path.histograms.items()}
    assert largest == {
        "send_lateness": 110_000 // 1024,
        "peer_and_wire": 290_000 // 1024,
        "wait": 600_000 // 1024,
        "use_lateness": 60_000 // 1024,
    }


def test_an_answer_that_comes_while_its_cycle_is_late_waited_for_the_rest_of_that_only() -> None:
    path = AnswerPath(budget_ns=MS)
    path.arrived.append((5 * MS, 300_000, 1))
    path.began(4 * MS, 6 * MS)
    assert (path.worst[0].wait_ns, path.worst[0].use_lateness_ns) == (0, MS)
    assert path.lateness_between(4 * MS, 7 * MS) == 2 * MS


def test_only_the_slowest_are_kept() -> None:
    path = AnswerPath(budget_ns=MS)
    for number in range(500):
        path.arrived.append((number * MS, (number * 7919) % 500, number))
        path.began(number * MS + 1, number * MS + 1)
    assert [one.age_ns for one in path.worst] == list(range(499, 499 - WORST, -1))


def test_the_grid_follows_a_clock_and_ignores_late_messages_until_a_row_of_them_shifts_it() -> None:
    grid = SendGrid(5 * MS)
    off = []
    for number in range(2000):
        late_ns = 3 * MS if number % 50 == 17 else 0
        at_ns = number * 5 * MS + number * 500 + late_ns  # a clock 100 ppm off
        off.append(at_ns - grid.due_ns(1, at_ns))
    assert max(off) > 2.9 * MS
    assert sorted(off)[1000] < 10_000
    for number in range(2000, 2100):
        at_ns = number * 5 * MS + number * 500 + 12 * MS
        off.append(at_ns - grid.due_ns(1, at_ns))
    assert grid.shifts == 1
    assert abs(off[-1]) < 20_000


def test_what_leaves_on_another_link_does_not_make_the_last_message_younger() -> None:
    bench = Bench(fri=FriSettings(peer=PEER, send_period_ms=5))
    bench.controller.tick(now_ns=0)
    (message,) = bench.controller.outgoing(now_ns=100_000)
    fri = bench.controller.fri
    assert fri is not None
    fri.departed(now_ns=3_100_000)  # a datagram of the servo link leaves
    answer = bench.client.answer(message.payload)
    assert answer is not None
    bench.controller.receive(answer, SOURCE, now_ns=3_900_000)
    bench.controller.tick(now_ns=4_000_000)
    assert fri.path.worst[0].age_ns == 3_800_000
