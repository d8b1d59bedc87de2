"""The operator's channel over a real socket with robots that only take notes; and its requests, read from bytes."""

import asyncio
import json
import os
import random
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from hil.client.pad_folder import MAX_SOCKET_PATH_BYTES, distrusted, make_socket_folder, socket_folder
from hil.clock import MonotonicClock, elapsed_ns
from hil.runtime import operator_channel
from hil.runtime.operator_channel import MAX_CONNECTIONS, OperatorChannel
from hil.runtime.pad_connection import BURST_REQUESTS, REQUEST_INTERVAL_NS, UNREAD_BYTES, Connection
from hil.runtime.pad_requests import MAX_LINE_BYTES, BadRequest, PadRequest, read_request
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import OperationMode
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput, SetOverride

ENABLE, RELEASE, STOP = Press(PadKey.ENABLE), Press(PadKey.RELEASE), Press(PadKey.EMERGENCY_STOP)


class Notes:
    """A robot that notes what the operator did."""

    def __init__(self, *, moves_real_drives: bool = False) -> None:
        self.moves_real_drives = moves_real_drives
        self.actions: list[OperatorAction] = []
        self.refuses = ""
        self.fails = False
        self.mode = "AUT"
        self.filling = ""
        self.happened = asyncio.Event()

    def operate(self, action: OperatorAction) -> str:
        if self.fails:
            raise BackendError("the arm is on fire")
        self.actions.append(action)
        self.happened.set()
        return self.refuses

    def operator_state(self) -> dict[str, object]:
        return {"mode": self.mode, "filling": self.filling, "cycles": len(self.actions), "time_s": 0.0}

    def kst_report(self) -> dict[str, object] | None:
        return {"sessions": 3}

    def description(self) -> dict[str, object]:
        return {"model": "lbr-iiwa-14-r820"}


class Pad:
    """The other end, as bytes."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def ask(self, **request: object) -> dict[str, Any]:
        self.writer.write(json.dumps(request).encode() + b"\n")
        return await self.line()

    async def line(self) -> dict[str, Any]:
        told = json.loads(await asyncio.wait_for(self.reader.readline(), 10))
        assert isinstance(told, dict)
        return told


@pytest.fixture
def folder() -> Iterator[Path]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="pad") as name:
        yield Path(name)


@pytest.fixture
def session(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that XDG_RUNTIME_DIR names."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder


@asynccontextmanager
async def serving(path: Path, **robots: Notes) -> AsyncIterator[OperatorChannel]:
    channel = OperatorChannel(str(path), robots, clock=MonotonicClock())
    channel.open()
    try:
        await channel.serve()
        yield channel
    finally:
        channel.close()


@asynccontextmanager
async def pad(channel: OperatorChannel) -> AsyncIterator[Pad]:
    reader, writer = await asyncio.open_unix_connection(channel.path)
    try:
        yield Pad(reader, writer)
    finally:
        writer.close()
        await asyncio.gather(writer.wait_closed(), return_exceptions=True)


async def happens(robot: Notes, action: OperatorAction) -> None:
    """Wait until a robot is told ``action`` as the last one."""
    while not robot.actions or robot.actions[-1] != action:
        robot.happened.clear()
        await asyncio.wait_for(robot.happened.wait(), 10)


@pytest.mark.parametrize(
    ("text", "request_"),
    [
        ('{"do": "enable"}', PadRequest(ENABLE)),
        ('{"do": "enable", "hold": true, "id": "x"}', PadRequest(ENABLE, hold=True, request_id="x")),
        ('{"do": "release", "robot": "left"}', PadRequest(RELEASE, robot="left")),
        ('{"do": "start"}', PadRequest(Press(PadKey.START))),
        ('{"do": "pause"}', PadRequest(Press(PadKey.PAUSE))),
        ('{"do": "estop", "id": 7}', PadRequest(STOP, request_id=7)),
        ('{"do": "reset"}', PadRequest(Press(PadKey.RESET))),
        ('{"do": "mode", "mode": "T1"}', PadRequest(SelectMode(OperationMode.T1))),
        ('{"do": "override", "percent": 50}', PadRequest(SetOverride(50.0))),
        ('{"do": "override", "percent": 150}', PadRequest(SetOverride(150.0))),
        ('{"do": "io", "name": "FRI.Count", "value": 7}', PadRequest(SetInput("FRI.Count", 7))),
        (
            '{"do": "io", "name": "FRI.Lamp", "value": true, "robot": "left"}',
            PadRequest(SetInput("FRI.Lamp", True), robot="left"),
        ),
        (' {"do": "status"} \r', PadRequest()),
        ('{"do": "watch"}', PadRequest(watch=True)),
    ],
)
def test_requests_are_read(text: str, request_: PadRequest) -> None:
    assert read_request(text.encode()) == request_


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "a line is no JSON object in UTF-8"),
        ("hello", 'valid is for example {"do": "status"}'),
        ("[1]", "a line is a list, no JSON object"),
        ("7", "a line is 7, no JSON object"),
        ("[" * 4000, "a line is no JSON object"),
        ("[" * 900 + "]" * 900, "no JSON object"),
        ("{}", "there is no do; valid: enable, release, start, pause, estop, reset, mode, override, push, io, "),
        ('{"do": 3}', "do 3 is unknown; valid: enable"),
        ('{"do": ["enable"]}', "do a list is unknown; valid: enable"),
        ('{"do": "jump"}', 'do "jump" is unknown; valid: enable'),
        ('{"do": "start", "now": true}', 'there is no key "now" in do start; valid: do, robot, id'),
        ('{"do": "enable", "holds": true}', 'there is no key "holds" in do enable; valid: do, robot, id, hold'),
        ('{"do": "enable", "hold": 1}', "hold 1 is neither true nor false"),
        ('{"do": "mode"}', "mode null is unknown; valid: T1, T2, AUT"),
        ('{"do": "mode", "mode": "T3"}', 'mode "T3" is unknown; valid: T1, T2, AUT'),
        ('{"do": "mode", "mode": {}}', "mode an object is unknown; valid: T1, T2, AUT"),
        ('{"do": "override"}', "percent null is no number; valid: 0 ... 100"),
        ('{"do": "override", "percent": true}', "percent true is no number"),
        ('{"do": "override", "percent": NaN}', "a line is no JSON object"),
        ('{"do": "override", "percent": ' + "9" * 4000 + "}", "is no number a computer has"),
        ('{"do": "io"}', "name null is no text; valid: the Group.Name of an input"),
        ('{"do": "io", "name": "FRI.Lamp", "value": "on"}', 'value "on" is neither a number nor true or false'),
        (
            '{"do": "io", "name": "FRI.Lamp", "percent": 1}',
            'no key "percent" in do io; valid: do, robot, id, name, value',
        ),
        ('{"do": "status", "robot": 1}', "robot 1 is no text"),
        ('{"do": "status", "id": 1.5}', "id 1.5 is neither a text nor a whole number"),
        ('{"do": "status", "id": true}', "id true is neither"),
        ('{"do": "status", "id": ' + "9" * 4000 + "}", "..."),
    ],
)
def test_what_is_no_request_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    refused = read_request(text.encode())
    assert isinstance(refused, BadRequest)
    assert sentence in refused.reason
    assert len(refused.reason) < 250


@pytest.mark.parametrize("seed", range(20))
def test_no_bytes_raise(seed: int) -> None:
    chance = random.Random(seed)
    pieces = [b'{"do": "override", "percent": 5, "id": 1}', b"\xff\xfe", b"\\ud800", b'"', b"{", b"[", b"1e999", b"\0"]
    for _ in range(500):
        line = bytearray(b"".join(chance.choices(pieces, k=chance.randrange(1, 8))))
        for _ in range(chance.randrange(4)):
            line[chance.randrange(len(line))] = chance.randrange(256)
        told = read_request(bytes(line))
        json.dumps(told.reason if isinstance(told, BadRequest) else told.request_id).encode()


def test_the_socket_and_its_folder_are_its_owners_alone(session: Path) -> None:
    before = os.umask(0)
    try:
        channel = OperatorChannel(None, {"arm": Notes()}, clock=MonotonicClock())
        channel.open()
    finally:
        os.umask(before)
    assert channel.path == session / "fri-hil" / f"{os.getpid()}.sock"
    assert stat.S_IMODE(channel.path.parent.stat().st_mode) == 0o700
    assert stat.S_IMODE(channel.path.stat().st_mode) == 0o600
    channel.close()
    channel.close()
    assert list(channel.path.parent.iterdir()) == []


def test_without_a_session_folder_of_ours_the_folder_is_a_temporary_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    for value in (str(folder / "nowhere"), "", "relative"):
        monkeypatch.setenv("XDG_RUNTIME_DIR", value)
        assert socket_folder() == folder / f"fri-hil-{os.geteuid()}"
    own = folder / "session"
    own.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(own))
    assert socket_folder() == own / "fri-hil"
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert socket_folder() == folder / "fri-hil-12345"


def test_a_folder_others_may_enter_is_refused(session: Path) -> None:
    chosen = session / "fri-hil"
    chosen.mkdir()
    chosen.chmod(0o755)
    with pytest.raises(ConfigurationError, match=r"is open to others \(mode 0755, 0700 is needed\); give another"):
        make_socket_folder()
    chosen.rmdir()
    (session / "elsewhere").mkdir(mode=0o700)
    chosen.symlink_to(session / "elsewhere")
    with pytest.raises(ConfigurationError, match="is a symbolic link; give another socket"):
        make_socket_folder()
    chosen.unlink()
    chosen.write_text("")
    with pytest.raises(ConfigurationError, match="is no folder"):
        make_socket_folder()


def test_somebody_elses_folder_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert distrusted(folder) == ""
    owner = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    assert distrusted(folder) == f"belongs to user {owner}, this is user {owner + 1}"


def test_sockets_of_dead_processes_are_removed_and_nothing_else(session: Path) -> None:
    folder = make_socket_folder()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, file, other = folder / f"{ended.pid}.sock", folder / "999999999.sock", folder / "notes.sock"
    living = folder / f"{os.getppid()}.sock"
    file.write_text("no socket")
    for place in (dead, living, other):
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(place))
    channel = OperatorChannel(None, {"arm": Notes()}, clock=MonotonicClock())
    channel.open()
    channel.close()
    assert set(folder.iterdir()) == {file, other, living}


@pytest.mark.parametrize(
    ("place", "sentence"),
    [
        ("", "cannot be the path of the pad's socket"),
        ("a\0b", "cannot be the path of the pad's socket"),
        ("/tmp/" + "x" * 200, f"a path of 205 bytes; a socket's may have {MAX_SOCKET_PATH_BYTES}"),  # noqa: S108
        ("/nowhere/at/all.sock", "cannot make the pad's socket /nowhere/at/all.sock: No such file or directory"),
        ("/dev/null", "/dev/null is there already, and it is no socket"),
        ("/dev/null/x", "cannot make the pad's socket /dev/null/x: Not a directory"),
    ],
)
def test_a_path_that_cannot_be_is_said_in_words(place: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        OperatorChannel(place, {}, clock=MonotonicClock()).open()
    assert sentence in str(caught.value)


def test_a_file_is_never_removed(folder: Path) -> None:
    for what in ("file", "link"):
        place = folder / what
        if what == "file":
            place.write_text("precious")
        else:
            place.symlink_to(folder / "file")
        with pytest.raises(ConfigurationError, match="it is no socket"):
            OperatorChannel(str(place), {}, clock=MonotonicClock()).open()
        assert place.read_text() == "precious"


async def test_a_stale_socket_is_replaced_and_a_live_one_is_not(folder: Path) -> None:
    place = folder / "x.sock"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(place))
    async with serving(place, arm=Notes()) as channel:
        with pytest.raises(ConfigurationError, match=r"a controller listens at .*x\.sock already"):
            OperatorChannel(str(place), {}, clock=MonotonicClock()).open()
        async with pad(channel) as one:
            assert (await one.ask(do="status"))["ok"] is True
    assert not place.exists()


async def test_what_took_the_sockets_place_stays(folder: Path) -> None:
    place = folder / "x.sock"
    async with serving(place, arm=Notes()):
        place.unlink()
        place.write_text("another one's")
    assert place.read_text() == "another one's"


async def test_actions_reach_the_robot_and_the_answer_has_its_state(folder: Path) -> None:
    robot = Notes()
    async with serving(folder / "x", arm=robot) as channel, pad(channel) as one:
        told = await one.ask(do="mode", mode="T1", id=1)
        assert told == {"ok": True, "robots": {"arm": robot.operator_state()}, "id": 1}
        await one.ask(do="override", percent=12.5, robot="arm")
        assert robot.actions == [SelectMode(OperationMode.T1), SetOverride(12.5)]
        robot.refuses = "there is no stop to acknowledge"
        refused = await one.ask(do="reset", id="r")
        assert (refused["ok"], refused["error"], refused["id"]) == (False, robot.refuses, "r")
        assert set(refused["robots"]) == {"arm"}
        robot.fails = True
        assert (await one.ask(do="start"))["error"] == "the arm is on fire"
        assert (await one.ask(do="status"))["ok"] is True


async def test_lines_in_pieces_and_several_at_once_are_answered_in_order(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel, pad(channel) as one:
        for piece in (b'{"do": "sta', b'tus", "id": 1}', b'\n{"do": "pause", "id": 2}\n\xff\n{"do": "status", "id": 3'):
            one.writer.write(piece)
            await one.writer.drain()
        assert [(await one.line()).get("id") for _ in range(3)] == [1, 2, None]
        one.writer.write(b"}")
        one.writer.write_eof()
        assert (await one.line())["id"] == 3
        assert await one.reader.read() == b""


async def test_a_line_that_is_too_long_is_answered_and_the_connection_closed(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel, pad(channel) as other:
        async with pad(channel) as one:
            one.writer.write(b" " * (MAX_LINE_BYTES - 16) + b'{"do": "status"}\n')
            assert (await one.line())["ok"] is True
            one.writer.write(b"x" * 100_000)
            assert "a line is longer than 4096 bytes; the connection is closed" in (await one.line())["error"]
            rest = await asyncio.gather(one.reader.read(), return_exceptions=True)
            assert rest[0] == b"" or isinstance(rest[0], ConnectionError)
        assert (await other.ask(do="status"))["ok"] is True


async def test_garbage_is_answered_and_the_connection_lives(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel, pad(channel) as one:
        for line in (b"\n", b"\xff\xfe\n", b'{"do": "status", "id": "\\ud800"}\n', b"[[[\n", b'{"do": 1}\n'):
            one.writer.write(line)
            assert isinstance((await one.line())["ok"], bool)
        assert (await one.ask(do="status"))["ok"] is True
        assert (channel.requests, channel.refused) == (6, 4)


async def test_one_of_several_robots_must_be_named_but_the_emergency_stop_stops_all(folder: Path) -> None:
    left, right = Notes(), Notes()
    async with serving(folder / "x", left=left, right=right) as channel, pad(channel) as one:
        assert set((await one.ask(do="status"))["robots"]) == {"left", "right"}
        assert set((await one.ask(do="status", robot="left"))["robots"]) == {"left"}
        refused = await one.ask(do="start")
        assert refused["error"] == "this controller has 2 robots: say which one (robot); valid: left, right"
        assert (await one.ask(do="start", robot="up"))["error"] == 'there is no robot "up"; valid: left, right'
        await one.ask(do="start", robot="right")
        assert (left.actions, right.actions) == ([], [Press(PadKey.START)])
        assert set((await one.ask(do="estop"))["robots"]) == {"left", "right"}
        assert (left.actions[-1], right.actions[-1]) == (STOP, STOP)


async def test_a_held_switch_is_let_go_when_the_connection_ends(folder: Path) -> None:
    robot = Notes()
    async with serving(folder / "x", arm=robot) as channel:
        async with pad(channel) as one:
            await one.ask(do="enable", hold=True)
            assert robot.actions == [ENABLE]
        await happens(robot, RELEASE)
        async with pad(channel) as one:
            await one.ask(do="enable")
        async with pad(channel) as one:
            await one.ask(do="status")
        assert robot.actions == [ENABLE, RELEASE, ENABLE]


async def test_one_pad_holds_and_any_may_let_go(folder: Path) -> None:
    robot = Notes()
    async with serving(folder / "x", arm=robot) as channel, pad(channel) as other:
        async with pad(channel) as one:
            await one.ask(do="enable", hold=True)
            await one.ask(do="enable", hold=True)
            refused = await other.ask(do="enable", hold=True)
            assert "another pad holds the enabling switch of arm" in refused["error"]
            await other.ask(do="release")
            await other.ask(do="enable")
        await other.ask(do="status")
        # The first one held nothing any more.
        assert robot.actions == [ENABLE, ENABLE, RELEASE, ENABLE]


async def test_a_refused_enabling_is_not_held(folder: Path) -> None:
    robot = Notes()
    async with serving(folder / "x", arm=robot) as channel, pad(channel) as other:
        async with pad(channel) as one:
            robot.refuses = "the controller shuts down"
            await one.ask(do="enable", hold=True)
        await other.ask(do="status")
        assert robot.actions == [ENABLE]


async def test_real_drives_need_a_switch_that_is_held(folder: Path) -> None:
    robot = Notes(moves_real_drives=True)
    async with serving(folder / "x", arm=robot) as channel:
        async with pad(channel) as one:
            refused = await one.ask(do="enable")
            assert "arm moves real drives: its enabling switch must be held" in refused["error"]
            assert robot.actions == []
            assert (await one.ask(do="enable", hold=True))["ok"] is True
        await happens(robot, RELEASE)


async def test_another_user_is_refused_and_root_is_not(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Notes()
    async with serving(folder / "x", arm=robot) as channel:
        monkeypatch.setattr(operator_channel, "peer_user", lambda _: os.geteuid() + 1)
        async with pad(channel) as one:
            assert f"this is user {os.geteuid() + 1}" in (await one.line())["error"]
            assert await one.reader.read() == b""
        monkeypatch.setattr(operator_channel, "peer_user", lambda _: 0)
        async with pad(channel) as one:
            assert (await one.ask(do="status"))["ok"] is True


def test_the_kernel_tells_who_is_there() -> None:
    here, there = socket.socketpair(socket.AF_UNIX)
    with here, there:
        assert operator_channel.peer_user(here) == os.geteuid()


async def test_an_idle_pad_makes_room_and_one_that_holds_or_watches_does_not(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel:
        pads = []
        for _ in range(MAX_CONNECTIONS):
            one = Pad(*await asyncio.open_unix_connection(channel.path))
            assert (await one.ask(do="status"))["ok"] is True
            pads.append(one)
        async with pad(channel) as one_more:
            assert (await one_more.ask(do="estop"))["ok"] is True
        assert "did nothing for the longest time" in (await pads[0].line())["error"]
        for one in pads[1:]:
            await one.ask(do="watch")
        async with pad(channel) as last:
            await last.ask(do="watch")
            one_more = Pad(*await asyncio.open_unix_connection(channel.path))
            assert "16 pads that hold or watch are connected" in (await one_more.line())["error"]
            pads.append(one_more)
        for one in pads:
            one.writer.close()
            await one.writer.wait_closed()


async def test_a_pad_that_asks_too_often_is_read_more_slowly_and_others_are_not(folder: Path) -> None:
    robot = Notes()
    more = 10
    async with serving(folder / "x", arm=robot) as channel, pad(channel) as one, pad(channel) as other:
        began_ns = elapsed_ns()
        one.writer.write(b'{"do": "status"}\n' * (BURST_REQUESTS + more))
        for _ in range(BURST_REQUESTS):
            await one.line()
        await other.ask(do="estop")
        assert channel.requests < BURST_REQUESTS + more
        for _ in range(more):
            await one.line()
        assert elapsed_ns() - began_ns >= (more - 1) * REQUEST_INTERVAL_NS
        assert robot.actions == [STOP]


async def test_a_watcher_is_shown_the_state_then_changes_and_a_line_a_second(folder: Path) -> None:
    robot, unwatched = Notes(), Notes()
    async with serving(folder / "x", arm=robot, other=unwatched) as channel, pad(channel) as one:
        first = await one.ask(do="watch", robot="arm", id=5)
        assert (first["robots"]["arm"]["mode"], first["id"]) == ("AUT", 5)
        robot.mode = "T1"
        channel.changed()
        change = await one.line()
        assert (change["watch"], change["lost"], change["id"]) == (True, 0, 5)
        assert set(change["robots"]) == {"arm"}
        assert change["robots"]["arm"]["mode"] == "T1"
        robot.actions.append(STOP)
        unwatched.mode = "T2"
        channel.changed()
        began_ns = elapsed_ns()
        await one.line()
        # What changes all the time, or elsewhere, is no change: this was the line of the second.
        assert elapsed_ns() - began_ns > 200_000_000
        assert (await one.line())["robots"]["arm"]["cycles"] == 1


async def test_a_watcher_that_never_reads_loses_lines_and_its_actions_still_count(folder: Path) -> None:
    robot = Notes()
    robot.filling = "x" * 20_000
    async with serving(folder / "x", arm=robot) as channel, pad(channel) as stuck, pad(channel) as one:
        stuck.reader._transport.pause_reading()  # type: ignore[attr-defined]
        stuck.writer.write(b'{"do": "watch"}\n')
        while not channel.lost_lines:
            robot.mode = f"{robot.mode[:3]}{channel.requests}"
            channel.changed()
            assert (await one.ask(do="status"))["ok"] is True
        connection = next(connection for connection in channel._connections if connection.watched)
        assert connection._transport is not None
        assert connection._transport.get_write_buffer_size() <= UNREAD_BYTES + 2 * len(robot.filling)
        stuck.writer.write(b'{"do": "estop"}\n')
        await happens(robot, STOP)


async def test_requests_of_pads_that_are_gone_do_not_pile_up(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel, pad(channel) as stays:
        await stays.ask(do="status")
        there = next(iter(channel._connections))
        for _ in range(1000):
            gone = Connection(channel, now_ns=MonotonicClock().now_ns)
            channel.queue(gone, b'{"do": "status"}')
            channel.left(gone)
        assert len(channel._waiting) == 0
        channel.queue(there, b'{"do": "status"}')
        assert (await stays.line())["ok"] is True


async def test_the_end_is_said_and_the_socket_removed(folder: Path) -> None:
    async with serving(folder / "x", arm=Notes()) as channel, pad(channel) as one:
        await one.ask(do="enable", hold=True)
        channel.close()
        assert (await one.line())["error"] == "the controller shuts down"
        assert await one.reader.read() == b""
        assert not channel.path.exists()
        assert channel.report() == {"socket": str(folder / "x"), "requests": 1, "refused": 0, "lost_lines": 0}
