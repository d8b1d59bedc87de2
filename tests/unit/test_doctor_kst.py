"""``hil doctor kst``: what a controller says of its KST links, made a verdict of, whatever is missing of it."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.kst.stalls import StallWatch
from hil.values.errors import EndpointError
from hil.values.finding import Diagnosis, Severity, Whose
from tests.support.cli import cli
from tests.support.kst_line import Line, asks_in_parts, ping_pong
from tools.doctor.kst.told import Link, links
from tools.doctor.kst.verdict import diagnose


def report(watch: StallWatch | None = None, **more: Any) -> dict[str, Any]:
    """Return what a controller tells of a link."""
    told = {
        "address": "127.0.0.1:30001",
        "fault": None,
        "strict": False,
        "nagle": False,
        "client": "127.0.0.1:51234",
        "phase": "idle",
        "sessions": 1,
        "second_clients": 0,
        "counters": {"lines": 500, "replies": 500, "set_points": 450},
        "refused": {},
        **more,
    }
    if watch is not None:
        told["tcp"] = watch.report()
    loaded: dict[str, Any] = json.loads(json.dumps(told))
    return loaded


def diagnosis(now: dict[str, Any], before: dict[str, Any] | None = None) -> Diagnosis:
    return diagnose(links({"arm": before}, {"arm": now}))


def kinds(found: Diagnosis) -> list[str]:
    return [finding.kind for finding in found.findings]


def rows(found: Diagnosis, table: int = 0) -> dict[str, str]:
    return {row[0]: row[1] for row in found.tables[table].rows}


def test_a_good_link_is_said_to_be_in_order_with_its_rate() -> None:
    line = ping_pong(Line(), count=500, pace_ms=2.0)
    before = report(line.watch)
    ping_pong(line, count=500, pace_ms=2.0)
    found = diagnosis(report(line.watch, counters={"lines": 1000, "replies": 1000, "set_points": 950}), before)
    assert kinds(found) == ["kst-healthy"]
    assert found.healthy
    assert "1000 requests, 950 set-points, 500 a second now" in found.verdict.sentence
    assert rows(found)["set-points a second, now"] == "500.0"
    assert rows(found)["between requests, ms: median, p99"] == "2.00, 2.00"
    assert found.tables[1].rows[0][0] == "request in parts"


def test_a_stall_is_the_verdict_as_the_link_tells_it() -> None:
    watch = asks_in_parts(Line()).watch
    found = diagnosis(report(watch))
    (told,) = watch.findings()
    assert kinds(found) == ["kst-request-in-parts"]
    assert found.verdict == told
    assert not found.healthy


def test_refusals_are_told_by_reason() -> None:
    found = diagnosis(report(StallWatch(False), refused={"busy": 2, "unknown command": 7}))
    assert kinds(found) == ["kst-refused"]
    assert (found.verdict.severity, found.verdict.whose) == (Severity.WARNING, Whose.APPLICATION)
    assert "9 of 500 lines were refused: unknown command 7, busy 2" in found.verdict.sentence
    assert rows(found, -1) == {"unknown command": "7", "busy": "2"}


def test_set_points_after_the_end_of_a_mode_and_a_dead_server_are_told() -> None:
    counters = {"lines": 9, "set_points_after_a_failed_mode": 5}
    found = diagnosis(report(counters=counters, fault="its process ended with code 1", second_clients=2))
    assert kinds(found) == ["kst-server-ended", "kst-set-points-unheard", "kst-second-client"]
    assert "5 set-points moved nothing" in found.findings[1].sentence


def test_nobody_came() -> None:
    found = diagnosis(report(sessions=0, client=None, counters={}))
    assert kinds(found) == ["kst-no-client"]
    assert "nothing to judge yet: no clients came" in found.verdict.sentence
    assert found.healthy


def test_where_the_system_tells_nothing_it_is_said() -> None:
    found = diagnosis(report(ping_pong(Line(tells=False), count=10, pace_ms=2.0).watch))
    assert kinds(found) == ["kst-healthy", "kst-kernel-silent"]


def test_several_links_are_told_apart_the_worst_first() -> None:
    good, bad = ping_pong(Line(), count=10, pace_ms=2.0).watch, asks_in_parts(Line()).watch
    found = diagnose(links({}, {"left": report(good), "right": report(bad), "third": None}))
    assert kinds(found) == ["kst-request-in-parts", "kst-healthy"]
    assert found.verdict.sentence.startswith("right: the client")
    assert found.findings[1].sentence.startswith("left: the KST link")


def test_no_link_is_a_sentence_that_says_how_to_get_one() -> None:
    with pytest.raises(EndpointError, match=r"has no KST link \(arm, leg\): start it with hil run --kst"):
        links({}, {"arm": None, "leg": None})


texts = st.text(max_size=6)
values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), texts),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(texts, inner, max_size=3)),
    max_leaves=6,
)
NAMES = ("address", "client", "sessions", "counters", "refused", "tcp", "fault", "strict", "second_clients")
IN_TCP = ("requests", "seconds", "stalls", "findings", "request_gap_ms", "kernel_tells", "reads")
findings = st.lists(
    st.dictionaries(st.sampled_from(("kind", "severity", "whose", "evidence", "figures", "sentence")), values),
    max_size=2,
)
tcps = st.one_of(
    values,
    st.dictionaries(st.sampled_from(IN_TCP), st.one_of(values, findings), max_size=6),
)


@given(
    st.dictionaries(st.sampled_from(NAMES), values, max_size=8),
    st.dictionaries(st.sampled_from(NAMES), values, max_size=8),
    tcps,
)
def test_whatever_is_missing_or_odd_is_left_out(before: dict[str, Any], now: dict[str, Any], tcp: object) -> None:
    found = diagnose([Link("arm", before, {**now, "tcp": tcp})])
    assert found.verdict.sentence
    json.dumps(found.as_dict())


@contextmanager
def pad(folder: Path, told: dict[str, object]) -> Iterator[Path]:
    """Answer every request of one pad client after the other with ``told``, until the block ends."""
    path = folder / "pad.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen(1)

        def serve() -> None:
            with listener.accept()[0] as link, link.makefile("rw") as lines:
                for line in lines:
                    request = json.loads(line)
                    assert request["do"] == "kst"
                    lines.write(json.dumps({"ok": True, "id": request["id"], "robots": told}) + "\n")
                    lines.flush()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield path
        finally:
            thread.join()


def test_the_command_asks_the_pad_and_nobody_else(tmp_path: Path) -> None:
    with pad(tmp_path, {"arm": report(asks_in_parts(Line()).watch)}) as path:
        ended = cli("doctor", "kst", "--socket", path, "--seconds", "0", "--json", "-")
    found = json.loads(ended.out)
    assert (ended.code, found["healthy"], found["findings"][0]["kind"]) == (1, False, "kst-request-in-parts")


def test_the_command_shows_sentence_evidence_and_tables(tmp_path: Path) -> None:
    with pad(tmp_path, {"arm": report(ping_pong(Line(), count=10, pace_ms=2.0).watch)}) as path:
        ended = cli("doctor", "kst", "--socket", path, "--robot", "arm", "--seconds", "0")
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("the KST link at 127.0.0.1:30001 is in order")
    assert "what waited, arm" in ended.out


def test_the_command_says_where_there_is_no_link(tmp_path: Path) -> None:
    with pad(tmp_path, {"arm": None}) as path:
        ended = cli("doctor", "kst", "--socket", path, "--seconds", "0")
    assert (ended.code, ended.out) == (2, "")
    assert "has no KST link (arm)" in ended.err
