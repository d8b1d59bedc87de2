"""The TCP doctor's verdict as a function of the figures, its remedies, and the registry of Windows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.values.finding import Diagnosis, Finding, Severity, Whose
from tests.support.cases import cases
from tools.doctor.tcp.cases import (
    ECHO_CASES,
    ONE_NAGLE,
    ONE_NO_DELAY,
    REPLY_NAGLE,
    RESPONDER_CASES,
    TWO_NAGLE,
    TWO_NAGLE_LATE,
    TWO_NO_DELAY,
    Case,
    CaseResult,
    Exchange,
    Measured,
)
from tools.doctor.tcp.remedies import System, nagle_remedies
from tools.doctor.tcp.verdict import delay_words, diagnose
from tools.doctor.tcp.windows import registry_finding

PEER = "10.0.0.2:30400"
QUICK = Exchange(total_ms=0.2, thought_ms=0.02)
PLACES = ("held_here_ms", "held_there_ms", "thought_ms")


def slow(place: str, by_ms: float) -> Exchange:
    """Return a round trip that lost ``by_ms`` at one place; an empty place is the network."""
    return Exchange(total_ms=0.2 + by_ms) if not place else Exchange(total_ms=0.2 + by_ms, **{place: by_ms})


def measured(
    exchanges: Mapping[Case, Sequence[Exchange]],
    *,
    nagle_there: bool | None = False,
    cases: Iterable[Case] = RESPONDER_CASES,
    here: str = "Linux",
    there: str = "Linux",
    echo: bool = False,
) -> Measured:
    """Return figures in which every case is quick but those told."""
    results = []
    for case in cases:
        result = CaseResult(case, nagle_there=nagle_there)
        for exchange in exchanges.get(case, [QUICK] * 5):
            result.add(exchange)
        results.append(result)
    return Measured(PEER, here, there, 0.3, tuple(results), echo=echo, kernel_round_trip_ms=0.1)


def kinds(diagnosis: Diagnosis) -> list[str]:
    return [finding.kind for finding in diagnosis.findings]


def test_a_quick_peer_is_healthy_and_the_sentence_has_the_figures() -> None:
    diagnosis = diagnose(measured({}))
    assert diagnosis.healthy
    assert diagnosis.verdict.sentence == (
        f"TCP to {PEER} is quick enough: a round trip takes 0.20 ms on average at most, where 5 ms are allowed (manual "
        "11.1); nothing is held, in one write or in two, with TCP_NODELAY here or without"
    )
    assert "n(5) T(0.20, 0.20, 0.20 msec) (stdDev 0.00)" in diagnosis.verdict.evidence[0]


def test_our_nagle_against_its_late_acknowledgement_names_this_side() -> None:
    diagnosis = diagnose(measured({TWO_NAGLE: [slow("held_here_ms", 43.8)] * 5}))
    assert kinds(diagnosis) == ["nagle-here"]
    assert not diagnosis.healthy
    assert diagnosis.verdict.whose is Whose.APPLICATION
    assert diagnosis.verdict.sentence == (
        "a message that this side writes in two parts takes 44.0 ms on average, where 5 ms are allowed (manual 11.1): "
        f"this side's Nagle algorithm holds the second part until {PEER} has acknowledged the first, and {PEER} "
        "acknowledges about 44 ms late, as Linux does (40 ms)"
    )
    assert diagnosis.verdict.remedies[0].startswith("this side: set TCP_NODELAY on the connection")
    assert any("quickack 1" in remedy and remedy.startswith(PEER) for remedy in diagnosis.verdict.remedies)
    assert not any("TcpAckFrequency" in remedy for remedy in diagnosis.verdict.remedies)


def test_its_nagle_against_our_late_acknowledgement_names_the_other_side() -> None:
    stalls = dict.fromkeys((ONE_NO_DELAY, ONE_NAGLE, TWO_NO_DELAY, TWO_NAGLE), [slow("held_there_ms", 41.0)] * 3)
    diagnosis = diagnose(measured(stalls, nagle_there=True, here="Windows"))
    assert kinds(diagnosis) == ["nagle-there"]
    assert diagnosis.verdict.whose is Whose.PEER
    assert f"{PEER} writes its reply in two parts, its Nagle algorithm holds the second" in diagnosis.verdict.sentence
    assert diagnosis.verdict.remedies[0].startswith(f"{PEER}: set TCP_NODELAY")
    registry = next(remedy for remedy in diagnosis.verdict.remedies if "TcpAckFrequency" in remedy)
    assert registry.startswith("this side: create TcpAckFrequency (REG_DWORD, value 1; ")
    assert r"HKEY_LOCAL_MACHINE\SYSTEM\CurrentControlSet\Services\Tcpip\Parameters\Interfaces\{" in registry


@pytest.mark.parametrize(
    ("delay_ms", "words"),
    [
        (40.0, "about 40 ms late, as Linux does (40 ms)"),
        (200.0, "about 200 ms late, as Windows does (200 ms)"),
        (120.0, "about 120 ms late (the manual has more than 100 ms for Windows)"),
        (500.0, "about 500 ms late (the manual has more than 100 ms for Windows)"),
        (16.0, "about 16 ms late"),
    ],
)
def test_the_length_of_a_delay_is_told_with_the_system_that_is_known_for_it(delay_ms: float, words: str) -> None:
    assert delay_words(delay_ms) == words
    diagnosis = diagnose(measured({TWO_NAGLE: [slow("held_here_ms", delay_ms)] * 4}))
    assert diagnosis.verdict.sentence.endswith(words)


def test_a_delay_that_the_told_system_does_not_have_gets_the_remedies_of_all() -> None:
    diagnosis = diagnose(measured({TWO_NAGLE: [slow("held_here_ms", 200.0)] * 4}, there="Linux"))
    assert any("TcpAckFrequency" in remedy for remedy in diagnosis.verdict.remedies)


def test_parts_that_come_apart_although_nothing_may_hold_them_are_the_networks() -> None:
    stalls = dict.fromkeys((TWO_NO_DELAY, TWO_NAGLE), [slow("held_here_ms", 210.0)] * 3)
    diagnosis = diagnose(measured(stalls))
    assert kinds(diagnosis) == ["uneven-network"]
    assert diagnosis.verdict.whose is Whose.WIRE


@pytest.mark.parametrize(
    ("place", "kind", "whose"),
    [("thought_ms", "slow-program-there", Whose.PEER), ("", "slow-network", Whose.WIRE)],
)
def test_what_is_slow_without_nagle_is_named(place: str, kind: str, whose: Whose) -> None:
    diagnosis = diagnose(measured(dict.fromkeys(RESPONDER_CASES, [slow(place, 8.0)] * 4)))
    assert kinds(diagnosis) == [kind]
    assert diagnosis.verdict.whose is whose
    assert "8.2 ms on average" in diagnosis.verdict.sentence


def test_what_is_slow_in_sum_only_is_told_so() -> None:
    exchange = Exchange(total_ms=7.0, thought_ms=3.5)
    diagnosis = diagnose(measured(dict.fromkeys(RESPONDER_CASES, [exchange] * 4)))
    assert kinds(diagnosis) == ["slow"]
    assert "network 3.5 ms, its program 3.5 ms" in diagnosis.verdict.sentence


def test_what_only_an_asked_peer_does_is_a_note() -> None:
    diagnosis = diagnose(
        measured(
            {REPLY_NAGLE: [slow("held_there_ms", 44.0)] * 4, TWO_NAGLE_LATE: [slow("held_here_ms", 44.0)] * 4},
        )
    )
    assert kinds(diagnosis) == ["tcp-healthy", "late-acknowledgement-here", "late-acknowledgement-there"]
    assert diagnosis.healthy


def test_an_echo_servers_nagle_is_not_told_from_the_network_and_ours_is_not_judged() -> None:
    stalls = {TWO_NO_DELAY: [slow("held_there_ms", 42.0)] * 4}
    diagnosis = diagnose(measured(stalls, cases=ECHO_CASES, nagle_there=None, there="", echo=True))
    assert kinds(diagnosis) == ["nagle-there"]
    assert diagnosis.verdict.whose is Whose.PEER_OR_WIRE
    healthy = diagnose(measured({}, cases=ECHO_CASES, nagle_there=None, there="", echo=True))
    assert healthy.verdict.sentence.endswith("an echo server shows its own Nagle only, not this side's")


def test_cases_the_time_did_not_suffice_for_are_told() -> None:
    figures = replace(measured({}, cases=RESPONDER_CASES[:5]), left_out=RESPONDER_CASES[5:])
    assert diagnose(figures).findings[-1].sentence == (
        "the time did not suffice for: asked: reply in two, Nagle; asked: late ACK; two writes, Nagle"
    )


exchanges = st.builds(
    slow, st.sampled_from([*PLACES, ""]), st.sampled_from([0.0, 1.0, 4.0, 6.0, 14.0, 16.0, 44.0, 201.0])
)
figures = st.dictionaries(st.sampled_from(RESPONDER_CASES), st.lists(exchanges, min_size=3, max_size=6), max_size=7)


@settings(max_examples=cases(30))
@given(figures, st.booleans())
def test_healthy_means_that_no_kind_of_message_is_slow_or_stalls(
    given_figures: dict[Case, list[Exchange]], nagle_there: bool
) -> None:
    found = measured(given_figures, nagle_there=nagle_there)
    as_is = [result for result in found.results if not result.case.asked]
    slow_one = any(result.total.mean_ms > 5.0 for result in as_is)
    diagnosis = diagnose(found)
    assert diagnosis.healthy or slow_one or any(r.held_here.stalled or r.held_there.stalled for r in as_is)
    assert not (diagnosis.healthy and slow_one)


@settings(max_examples=cases(30))
@given(figures)
def test_what_an_asked_peer_does_never_makes_it_ill(given_figures: dict[Case, list[Exchange]]) -> None:
    asked = {case: exchanges for case, exchanges in given_figures.items() if case.asked}
    assert diagnose(measured(asked)).healthy


@settings(max_examples=cases(30))
@given(figures, st.permutations(RESPONDER_CASES))
def test_the_order_of_the_cases_does_not_matter(
    given_figures: dict[Case, list[Exchange]], order: Sequence[Case]
) -> None:
    def told(cases: Iterable[Case]) -> set[tuple[str, Severity]]:
        findings: tuple[Finding, ...] = diagnose(measured(given_figures, cases=cases)).findings
        return {(finding.kind, finding.severity) for finding in findings}

    assert told(order) == told(RESPONDER_CASES)


@settings(max_examples=cases(30))
@given(figures, st.floats(0.0, 50.0))
def test_a_slower_network_never_heals_anything(given_figures: dict[Case, list[Exchange]], more_ms: float) -> None:
    slower = {
        case: [replace(exchange, total_ms=exchange.total_ms + more_ms) for exchange in exchanges]
        for case, exchanges in given_figures.items()
    }
    assert diagnose(measured(given_figures)).healthy or not diagnose(measured(slower)).healthy


@given(st.floats(15.0, 500.0), st.integers(2, 6))
def test_a_held_part_always_names_the_side_that_holds_it(held_ms: float, count: int) -> None:
    here = diagnose(measured({TWO_NAGLE: [slow("held_here_ms", held_ms)] * count}))
    there = diagnose(measured({ONE_NO_DELAY: [slow("held_there_ms", held_ms)] * count}, nagle_there=True))
    assert (here.verdict.kind, there.verdict.kind) == ("nagle-here", "nagle-there")


def test_one_hiccup_of_many_is_no_stall() -> None:
    diagnosis = diagnose(measured({TWO_NAGLE: [slow("held_here_ms", 30.0), *[QUICK] * 19]}))
    assert kinds(diagnosis) == ["tcp-healthy"]


@pytest.mark.parametrize("system", System)
def test_remedies_are_those_of_the_system_and_begin_with_the_most_effective(system: System) -> None:
    remedies = nagle_remedies(sender="A", acknowledger="B", sender_system=system, acknowledger_system=system)
    text = "\n".join(remedies)
    assert remedies[0].startswith("A: set TCP_NODELAY")
    assert "write each message with one call" in remedies[1]
    assert ("TcpAckFrequency" in text, "TCPNoDelay" in text) == (system is not System.LINUX,) * 2
    assert ("TCP_QUICKACK" in text, "sysctl" in text) == (system is not System.WINDOWS,) * 2


def test_remedies_without_a_system_are_those_of_all() -> None:
    assert nagle_remedies(sender="A", acknowledger="B") == nagle_remedies(
        sender="A", acknowledger="B", sender_system=System.named("Haiku"), acknowledger_system=System.OTHER
    )


class FakeRegistry:
    """Two adapters; the second one has this side's address."""

    def __init__(self, values: Mapping[str, tuple[object, int]], *, broken: bool = False) -> None:
        self._folders: dict[str, Mapping[str, tuple[object, int]]] = {
            "{1}": {"IPAddress": (["192.168.0.9"], 7)},
            "{2}": {"DhcpIPAddress": ("10.0.0.1", 1), **values},
        }
        self._broken = broken

    def adapters(self) -> Iterable[str]:
        if self._broken:
            raise PermissionError(13, "Access is denied")
        return self._folders

    def values(self, adapter: str) -> Mapping[str, tuple[object, int]]:
        return self._folders[adapter]


SET = {"TcpAckFrequency": (1, 4), "TCPNoDelay": (1, 4)}


@pytest.mark.parametrize(
    ("values", "kind", "said"),
    [
        (SET, "registry-set", "has TcpAckFrequency and TCPNoDelay for this side's adapter (10.0.0.1)"),
        ({}, "registry-not-set", r"Interfaces\{2}: there is no TcpAckFrequency; there is no TCPNoDelay"),
        (SET | {"TCPNoDelay": (0, 4)}, "registry-not-set", "TCPNoDelay is 0, it must be 1"),
        (SET | {"TCPNoDelay": ("1", 1)}, "registry-not-set", "TCPNoDelay is no REG_DWORD"),
        (
            {"TcpAckFrequency": (1, 4), "TcpNoDelay": (1, 4)},
            "registry-not-set",
            "TcpNoDelay is there, but its name must be written TCPNoDelay",
        ),
    ],
)
def test_the_registry_keys_are_read_as_the_manual_wants_them(
    values: dict[str, tuple[object, int]], kind: str, said: str
) -> None:
    finding = registry_finding(FakeRegistry(values), "10.0.0.1")
    assert finding.kind == kind
    assert said in finding.sentence
    assert bool(finding.remedies) == (kind == "registry-not-set")


def test_a_registry_that_has_not_our_adapter_or_cannot_be_read_is_told() -> None:
    assert registry_finding(FakeRegistry(SET), "10.0.0.7").kind == "registry-no-adapter"
    assert "Access is denied" in registry_finding(FakeRegistry(SET, broken=True), "10.0.0.1").sentence
