"""``hil report``: what the page of a recording holds, and what it does with what is in a file."""

import base64
import hashlib
import json
import math
import struct
from collections.abc import Callable
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tools.bench.recording as bench_recording
from hil.core.events import Diagnosed
from hil.values.finding import Finding, Severity, Whose
from hil.values.fri import OperationMode
from hil.values.operator import PadKey, Press, SelectMode
from tests.support.cli import cli
from tests.support.recordings import fri_robot, header_of, packets, record, records, rewrite, servo_robot
from tools.bench.recording import VirtualRun
from tools.report.envelope import Envelope
from tools.report.making import Made, make_report
from tools.report.page import PageText, build_page
from tools.report.record import Lane, Latencies, MarkKind, RobotRecord
from tools.report.verdict import verdict_of
from transport.capture.journal import EndEntry, Entry, LostEntry, encode_entry, read_entries
from transport.capture.records import CapturedDatagram, Notes
from transport.capture.writing import PcapngWriter
from transport.servo import write_key

HOSTILE = "</script><img src=x onerror=alert(1)>"


class Page(HTMLParser):
    """What a browser makes of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        self._in = ""
        self.source = file.read_text(encoding="utf-8")
        self.feed(self.source)
        self.data: list[dict[str, Any]] = json.loads(self.scripts[0])["robots"]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._in = tag

    def handle_endtag(self, tag: str) -> None:
        self._in = ""

    def handle_data(self, data: str) -> None:
        if self._in == "script":
            self.scripts.append(data)
        elif self._in != "style":
            self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(self.texts)

    def lane(self, name: str, robot: int = 0) -> list[str]:
        """The labels of a lane in order."""
        return [span[2] for lane in self.data[robot]["lanes"] if lane["name"] == name for span in lane["spans"]]

    def series(self, *path: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        found: Any = self.data[0]
        for name in path:
            found = found[name]
        times = np.frombuffer(base64.b64decode(found["x"]), dtype="<u4") * found["step"]
        return times, np.frombuffer(base64.b64decode(found["y"]), dtype="<f4")


def answers_take(patch: pytest.MonkeyPatch, shortest_ms: float, longest_ms: float) -> None:
    patch.setattr(bench_recording, "_SHORTEST_ANSWER_NS", int(shortest_ms * 1e6))
    patch.setattr(bench_recording, "_LONGEST_ANSWER_NS", int(longest_ms * 1e6))


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with an emergency stop, and answers that are late for a while."""
    file = tmp_path_factory.mktemp("report") / "run.pcapng"

    def during(run: VirtualRun) -> None:
        run.operate(Press(PadKey.EMERGENCY_STOP))
        run.run(0.2)
        run.operate(Press(PadKey.RESET))
        run.operate(SelectMode(OperationMode.T1))
        with pytest.MonkeyPatch.context() as patch:
            answers_take(patch, 4.0, 9.0)
            run.run(0.2)

    return record(file, fri_robot(fri={"send_period_ms": 5, "quality_rise_ms": 40}), 0.6, during=during)


@pytest.fixture(scope="module")
def own_page(own: Path) -> Page:
    """Its page."""
    return Page(make_report(own, own.with_suffix(".html")).file)


@pytest.fixture
def file(own: Path, tmp_path: Path) -> Path:
    copy = tmp_path / "run.pcapng"
    copy.write_bytes(own.read_bytes())
    return copy


def paged(file: Path, **more: Any) -> tuple[Made, Page]:
    made = make_report(file, file.with_suffix(".html"), **more)
    return made, Page(made.file)


def from_elsewhere(file: Path, out: Path, *, port: int = 0) -> Path:
    """As tcpdump would have recorded it."""
    with PcapngWriter(out, comment="tcpdump") as writer:
        for one in packets(file):
            (host, number), (peer, peer_number) = one.source, one.destination
            writer.write(
                CapturedDatagram(one.at_unix_ns, (host, number + port), (peer, peer_number + port), one.payload)
            )
    return out


def together(first: Path, second: Path, out: Path) -> Path:
    """One recording of two robots, made of two of one each."""
    told, other = (json.loads(header_of(file).to_comment()) for file in (first, second))
    start, config = other["robots"][0], other["station"]["robot"][0]
    start["name"] = config["name"] = "second"
    moved = {(host, port): (host, port + 1000) for host, port in start["bound"].values()}
    start["bound"] = {link: moved[host, port] for link, (host, port) in start["bound"].items()}
    told["robots"].append(start)
    told["station"]["robot"].append(config)
    with PcapngWriter(out, comment=json.dumps(told)) as writer:
        for number, file in enumerate((first, second)):
            for one in records(file):
                if isinstance(one, Notes):
                    writer.note(b"".join(_noted(entry, number) for entry in read_entries(one.entries)))
                    continue
                source, destination = one.source, one.destination
                if number:
                    source, destination = moved.get(source, source), moved.get(destination, destination)
                writer.write(CapturedDatagram(one.at_unix_ns, source, destination, one.payload))
        writer.note(encode_entry(EndEntry()))
    return out


def _noted(entry: Entry, robot: int) -> bytes:
    if isinstance(entry, EndEntry):
        return b""
    return encode_entry(entry if isinstance(entry, LostEntry) else entry._replace(robot=robot))


@pytest.mark.parametrize("samples", [0, 1, 4096, 9_001, 40_000])
@pytest.mark.parametrize("most_bins", [8, 2048])
def test_thinning_loses_no_peak_and_stays_bounded(samples: int, most_bins: int) -> None:
    chooser = np.random.default_rng(samples)
    values = chooser.standard_normal((samples, 2))
    values[chooser.random(samples) < 0.2, 1] = np.nan
    envelope = Envelope(2, most_bins=most_bins)
    for at, (one, other) in enumerate(values.tolist()):
        envelope.add((at * 1e-3, one, other))
    for column in (0, 1):
        times, kept = envelope.points(column)
        assert len(times) <= 2 * (most_bins + 1)
        assert (np.diff(times) >= 0).all()
        # Every point is a sample, at its own time; and no stretch of time has a value beyond those kept of it.
        there = np.round(times * 1e3).astype(int)
        assert (values[there, column] == kept).all()
        width = envelope.thinned
        for begin in range(0, samples, width):
            stretch = values[begin : begin + width, column]
            if np.isfinite(stretch).any():
                inside = kept[(there >= begin) & (there < begin + width)]
                assert inside.max() == np.nanmax(stretch)
                assert inside.min() == np.nanmin(stretch)
    assert envelope.samples == samples
    assert envelope.thinned == 1 or samples > most_bins


def test_what_is_kept_of_a_robot_is_bounded() -> None:
    lane, robot = Lane("x"), RobotRecord("arm", "model", "", "", inside_known=True)
    for at in range(5_000):
        lane.change(float(at), str(at % 2), "why")
        robot.stopped(float(at), "again")
        robot.tell(float(at), f"line {at}")
    assert len(lane.spans) + lane.not_kept == 4_999
    assert len(lane.spans) < 2_000 > len(robot.marks)
    assert robot.stop_count == 5_000
    page = build_page(PageText("x", verdict_of([robot], own=True), []), [robot])
    assert b"the arm was stopped 5000 times, first at 0.000 s: again" in page
    assert b"line 0<" in page
    assert b"line 4999<" in page
    assert b"... 4500 more ..." in page


def test_latencies_are_counted_each() -> None:
    times = Latencies()
    for at in range(10_000):
        times.add(at * 1e-3, 0.1 if at % 100 else 7.0, budget_ms=5.0)
    times.add(10.0, 0.0, budget_ms=5.0)
    times.add(10.0, 1e6, budget_ms=5.0)
    assert times.count == sum(count for _, _, count in times.bars()) == 10_002
    assert times.late == 101
    assert times.quantile_ms(0.5) == pytest.approx(0.1, rel=0.13)
    assert times.quantile_ms(1.0) == times.largest_ms == 1e6


def test_a_recording_of_ours_is_known_from_the_inside(own_page: Page) -> None:
    page = own_page
    assert "identical to the byte: what is inside the controller is known" in page.text
    assert "This page is not what happened" not in page.text
    assert page.lane("session")[:4] == ["MONITORING_WAIT", "MONITORING_READY", "COMMANDING_WAIT", "COMMANDING_ACTIVE"]
    assert page.lane("arm")[:3] == ["holding", "overlay", "braking"]
    assert page.lane("mode") == ["AUT", "T1"]
    assert {"EMERGENCY_STOP", "RUNNING"} <= set(page.lane("program"))
    assert "EXCELLENT" in page.lane("quality")
    stops = [mark[2] for mark in page.data[0]["marks"] if mark[1] == "stop"]
    assert stops[0] == "stop of category 1: the emergency stop was pressed"
    assert "the emergency stop was pressed" in page.text
    # The margins, the dropped packets with the last one in words, the configuration.
    for told in ("axis velocity", "late", "ms over the budget of 5 ms", "send period ms", "lbr-iiwa-14-r820"):
        assert told in page.text.replace("_", " ")
    # Commanded and measured of an ideal arm are the same; latencies are those of the core.
    times, difference = page.series("axes", 3, "difference")
    assert times[0] == 0.0
    assert abs(difference).max() < 1e-3
    _, answers = page.series("latency")
    assert 8.0 < answers.max() < 9.2
    assert page.data[0]["budget"] == 5.0
    assert sum(bar[2] for bar in page.data[0]["bars"]) == len(answers)
    _, speed = page.series("speed")
    assert 1.0 < speed.max() < 40.0
    assert page.data[0]["moved"] == 3


def test_a_page_may_run_its_own_scripts_and_ask_nobody(own_page: Page) -> None:
    from plotly.offline import get_plotlyjs

    page = own_page
    policy = next(
        one["content"] or "" for tag, one in page.tags if tag == "meta" and "Policy" in (one.get("http-equiv") or "")
    )
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    allowed = rules["script-src"].split()
    digest = "'sha256-{}'".format
    for script in (page.scripts[2], get_plotlyjs()):
        assert digest(base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()) in allowed
    assert len(allowed) == 2
    assert not [one for _, one in page.tags if {"src", "href", "srcset", "action"} & set(one)]


def test_what_a_file_says_is_text_and_nothing_else(tmp_path: Path) -> None:
    file = record(tmp_path / "run.pcapng", fri_robot(name=HOSTILE[:40]), 0.05)
    told = json.loads(header_of(file).to_comment())
    told["machine"] = {"<b>system</b>": HOSTILE}
    rewrite(file, lambda one: iter((one,)), comment=json.dumps(told))
    _, page = paged(file)
    assert [tag for tag, _ in page.tags].count("script") == 3
    assert not {"img", "b"} & {tag for tag, _ in page.tags}
    assert HOSTILE[:40] in page.text
    assert HOSTILE in page.text
    assert page.data[0]["name"] == HOSTILE[:40]


def test_findings_come_first_with_their_evidence_and_remedies(tmp_path: Path) -> None:
    bad = Finding(
        "seconds-hand",
        Severity.FAULT,
        Whose.APPLICATION,
        f"the goal is reached first {HOSTILE}",
        evidence=("21 ms between destinations",),
        remedies=("set the minimum execution time to 32 ms",),
    )
    robot = RobotRecord("arm", "model", "", "", inside_known=True)
    kept = {"subject": "motion 1", "first_s": 1.0, "last_s": 2.0, "count": 7}
    motions = [{"number": 1, "kind": HOSTILE, "executed": 41}, {"number": 2, "superseded": 3}]
    robot.report = {"findings": [kept | bad.as_dict()], "servo": {"motions": motions}}
    robot.mark(1.0, MarkKind.FINDING, str(Diagnosed(0, bad)))
    other = RobotRecord("other", "model", "", "", inside_known=True)
    other.stopped(0.5, "braked")
    verdict = verdict_of([other, robot], own=True)
    assert verdict.severity is Severity.FAULT
    assert verdict.sentence.startswith("arm: the goal is reached first")
    file = tmp_path / "page.html"
    file.write_bytes(build_page(PageText("x", verdict, []), [other, robot]))
    page = Page(file)
    for text in ("21 ms between destinations", "set the minimum execution time to 32 ms", "7 times, 1.0 to 2.0 s"):
        assert text in page.text
    # Lists of records that nobody announced are tables.
    for text in ("Set points, motion by motion", "superseded", "executed", "41", HOSTILE):
        assert text in page.texts
    assert "img" not in {tag for tag, _ in page.tags}


def test_a_servo_run_shows_its_application(tmp_path: Path) -> None:
    file = record(tmp_path / "servo.pcapng", servo_robot(), 0.3)
    made, page = paged(file)
    assert made.verdict.startswith("nothing found: no stop in 0.3")
    assert page.lane("motion") == ["1 SMART_SERVO"]
    assert page.lane("application") == ["bench at 127.0.0.1:40000"]
    assert page.data[0]["latency"] is None


def test_a_keyed_link_needs_its_key(tmp_path: Path) -> None:
    key, moved, file = tmp_path / "key", tmp_path / "moved", tmp_path / "run.pcapng"
    write_key(key)
    run = VirtualRun(servo_robot(servo={"key_file": key}), Silent(), file)
    run.run(0.02)
    run.close()
    key.rename(moved)
    ended = cli("report", file)
    assert ended.code == 2
    assert "cannot be made here: cannot read key file" in ended.err
    assert cli("report", file, "--servo-key", moved).code == 0


class Silent:
    """A client that never says anything."""

    def answer(self, outgoing: object) -> tuple[()]:
        return ()

    def check(self, controller: object) -> None:
        return


def test_two_robots_have_a_section_each(tmp_path: Path, own: Path) -> None:
    servo = record(tmp_path / "servo.pcapng", servo_robot(), 0.1)
    made, page = paged(together(own, servo, tmp_path / "both.pcapng"))
    assert "identical to the byte" in page.text
    assert [robot["name"] for robot in page.data] == ["arm", "second"]
    assert [one.get("class") for _, one in page.tags].count("robot") == 2
    assert made.verdict.startswith("arm: ")
    assert page.lane("motion", 1) == ["1 SMART_SERVO"]


def test_a_replay_that_is_not_identical_is_said_first(file: Path) -> None:
    told = json.loads(header_of(file).to_comment())
    told["station"]["robot"][0]["fri"]["quality_rise_ms"] = 250
    rewrite(file, lambda one: iter((one,)), comment=json.dumps(told))
    _, page = paged(file)
    alarm = next(at for at, one in enumerate(page.tags) if one[1].get("class") == "alarm")
    verdict = next(at for at, one in enumerate(page.tags) if one[1].get("id") == "verdict")
    assert alarm < verdict
    assert "is not identical with the recording" in page.text
    assert "what is inside the controller is known" not in page.text


def test_a_recording_from_elsewhere_shows_what_its_packets_tell(tmp_path: Path, own: Path, own_page: Page) -> None:
    elsewhere = from_elsewhere(own, tmp_path / "cabinet.pcapng")
    _, page = paged(elsewhere)
    assert "assumed robot model: lbr-iiwa-14-r820 (the packets do not name it; --robot chooses another)" in page.text
    assert "Not replayed" in page.text
    assert "COMMANDING_ACTIVE" in page.lane("session")
    assert "SAFETY_STOP_LEVEL_1" in page.lane("safety")
    for told in ("Where the time of the answers went", "message to answer, at the capture's place"):
        assert told in page.text
    for place in (("axes", 3, "measured"), ("speed",)):
        assert page.series(*place)[1].max() == pytest.approx(own_page.series(*place)[1].max(), rel=0.02)
    assert page.series("latency")[1].max() == pytest.approx(own_page.series("latency")[1].max(), abs=1e-3)
    ended = cli("report", elsewhere, "--robot", "lbr-iiwa-7-r800", "--fri-version", "1.14", "-o", tmp_path / "x.html")
    assert ended.code == 0, ended.err
    assert "assumed robot model: lbr-iiwa-7-r800" in Page(tmp_path / "x.html").text


def test_controllers_from_elsewhere_have_a_section_each(tmp_path: Path, own: Path) -> None:
    one, other = from_elsewhere(own, tmp_path / "1.pcapng"), from_elsewhere(own, tmp_path / "2.pcapng", port=100)
    with PcapngWriter(tmp_path / "both.pcapng", comment="") as writer:
        for packet in sorted((*packets(one), *packets(other)), key=lambda packet: packet.at_unix_ns):
            writer.write(packet.datagram)
    _, page = paged(tmp_path / "both.pcapng")
    assert [robot["name"] for robot in page.data] == ["arm at 127.0.0.1:30210", "arm at 127.0.0.1:30310"]
    assert page.lane("session", 0) == page.lane("session", 1)


@pytest.mark.parametrize("make", [lambda own, _: own, from_elsewhere], ids=["ours", "elsewhere"])
def test_of_a_damaged_file_the_page_shows_what_is_before_the_damage(
    tmp_path: Path, file: Path, make: Callable[[Path, Path], Path]
) -> None:
    damaged = make(file, tmp_path / "other.pcapng")
    content = damaged.read_bytes()
    damaged.write_bytes(content[: len(content) * 2 // 3 + 1])
    ended = cli("report", damaged)
    assert ended.code == 2
    assert "what is before that" in ended.out
    page = Page(damaged.with_name(f"{damaged.name}.html"))
    assert "The file is damaged; what is before the damage is shown" in page.text
    assert "COMMANDING_ACTIVE" in page.lane("session")


def test_one_line_tells_the_page_and_its_size(file: Path) -> None:
    ended = cli("report", file)
    assert ended.code == 0, ended.err
    page = file.with_name("run.pcapng.html")
    assert ended.out.splitlines()[-1] == f"page: {page} ({page.stat().st_size / 1e6:.1f} MB)"
    assert sorted(one.name for one in file.parent.iterdir()) == ["run.pcapng", "run.pcapng.html"]


def _stranger(file: Path) -> None:
    with PcapngWriter(file, comment="") as writer:
        writer.write(CapturedDatagram(10**18, ("10.0.0.1", 53), ("10.0.0.2", 53), b"no FRI at all"))


def _only_servo(file: Path) -> None:
    record(file, servo_robot(), 0.05)
    told = json.loads(header_of(file).to_comment())
    told["robots"][0]["cycles_before"] = 7
    rewrite(file, lambda one: iter((one,)), comment=json.dumps(told))


def _elsewhere(file: Path) -> None:
    from_elsewhere(record(file.with_name("own.pcapng"), fri_robot(), 0.02), file)


BAD: list[tuple[str, Callable[[Path], object], tuple[str, ...], str]] = [
    ("nothing", _stranger, (), "holds no FRI session and no servo link (1 other datagrams): nothing to report"),
    ("servo alone", _only_servo, (), "holds no FRI session, and the servo link needs the whole recording"),
    ("no file", lambda _: None, (), "No such file"),
    ("no capture", partial(Path.write_bytes, data=b"\x00" * 40), (), "run.pcapng"),
    ("folder", _stranger, ("-o", "no/such/page.html"), "there is no folder"),
    ("itself", _stranger, ("-o", "run.pcapng"), "is the capture itself"),
    ("named", lambda file: record(file, fri_robot(), 0.02), ("--robot", "lbr-iiwa-7-r800"), "names its robot"),
    ("model", _elsewhere, ("--robot", "kr-5"), "kr-5"),
]


@pytest.mark.parametrize(("make", "options", "told"), [one[1:] for one in BAD], ids=[one[0] for one in BAD])
def test_where_there_is_no_page_there_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], object], options: Any, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("run.pcapng")
    make(file)
    before = file.read_bytes() if file.exists() else b""
    ended = cli("report", file, *options)
    assert ended.code == 2
    assert told in ended.err
    assert ended.err.count("\n") == 1
    assert (file.read_bytes() if file.exists() else b"") == before
    assert not list(tmp_path.glob("*.html"))


def test_positions_no_arm_has_are_left_out(tmp_path: Path, own: Path) -> None:
    """Numbers that are none, in a recording from elsewhere."""
    odd = 0
    with PcapngWriter(tmp_path / "odd.pcapng", comment="") as writer:
        for one in packets(own)[:100]:
            payload = one.payload.replace(struct.pack("<d", math.radians(40.0)), struct.pack("<d", float("nan")))
            odd += payload != one.payload
            writer.write(CapturedDatagram(one.at_unix_ns, one.source, one.destination, payload))
    assert odd > 50
    _, page = paged(tmp_path / "odd.pcapng")
    assert len(page.series("axes", 3, "measured")[0]) < 50
    assert page.lane("session")
