"""Replays a capture file: as what it is, with progress and pace."""

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

from hil.arithmetic import arithmetic_fingerprint
from hil.clock import elapsed_ns
from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK
from hil.replay.elsewhere import Beside
from hil.replay.exact import ExactReplay, Observe
from hil.replay.guess import Flow, flow_of
from hil.replay.result import ReplayResult, Watcher
from hil.runtime.capture_header import ARITHMETIC, CaptureHeader, read_header
from hil.values.errors import BackendError, MalformedDatagram, UsageError
from hil.values.fri import Release
from hil.values.link import Address
from transport.capture.errors import CaptureError
from transport.capture.journal import Entry, JournalError, encode_entry, read_entries, single_tick
from transport.capture.parts import first_and_number, parts_from
from transport.capture.reading import RecordReader, read_records, read_section_comment
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.writing import PcapngWriter
from transport.fri import FriCodec

_PROGRESS_EVERY: Final = 2000
_RECORDS_AT_ONCE: Final = 3000
_MOST_FLOWS: Final = 16
_OUR_COMMENT: Final = '{"software":"fri-hil'
_LEAST_LOOKED_AT: Final = 1000
_MOST_LOOKED_AT: Final = 200_000
"""Datagrams that are looked at before a recording is compared, to learn what its controllers were."""

ProgressTold = Callable[[int, int, str], None]
"""Told bytes read, bytes in all, and in words how fast it goes."""


class Wish(NamedTuple):
    """How a recording from elsewhere is to be taken; None: as it looks."""

    release: Release | None = None
    model: str | None = None
    backend: str | None = None


def replay_file(
    file: Path,
    *,
    wish: Wish | None = None,
    key_file: Path | None = None,
    progress: ProgressTold | None = None,
    pace: Callable[[int], None] | None = None,
    update: bool = False,
    watch: Watcher | None = None,
) -> ReplayResult:
    """Replay ``file``, with the parts of its ring behind it; raise ``CaptureError`` only where nothing can be read.

    A complete recording of ours goes through a fresh controller to the byte; any other is compared with an emulator
    that is set up as the recording looks. ``key_file`` is the servo link's key, where it is not where it was.
    """
    header = read_header(read_section_comment(file))
    if header is not None and key_file is not None:
        header = header.with_key(key_file)
    if wish is None and header is not None and own_header(file) is not None:
        return replay_own(file, header, progress=progress, pace=pace, update=update, watch=watch)
    if update:
        raise UsageError(f"{file} was not recorded by fri-hil from the start of a run: it has no outputs to update")
    return replay_elsewhere(file, header, wish or Wish(), progress=progress, pace=pace, watch=watch)


def replay_elsewhere(
    file: Path,
    header: CaptureHeader | None,
    wish: Wish,
    *,
    progress: ProgressTold | None = None,
    pace: Callable[[int], None] | None = None,
    watch: Watcher | None = None,
) -> ReplayResult:
    """Compare what controllers say in ``file`` with emulators beside them."""
    result = ReplayResult(str(file), own=False)
    parts = parts_from(file)
    if header is not None:
        tell_why_not_own(header, file, result)
    elif (read_section_comment(file) or "").startswith(_OUR_COMMENT):
        result.note("it looks like one of fri-hil, but what it says of its run is damaged: compared, not replayed")
    flows = _looked_through(packets_of(file), wish)
    began_ns = elapsed_ns()
    beside: dict[tuple[Address, Address], Beside] = {}
    with ExitStack() as opened:
        for number, flow in enumerate(flows.values()):
            name = f"{flow.controller}" if len(flows) > 1 else "arm"
            config = flow.config(_base_config(header, number, flow, wish), backend=wish.backend)
            emulator = Beside(flow, config, result, name=name, pace=pace, watch=watch)
            opened.callback(emulator.close)
            beside[flow.controller, flow.client] = emulator
            for note in flow.notes:
                result.note(f"{name}: {note}")
        for record in records_of(parts, result, progress):
            if isinstance(record, Notes):
                continue
            source, destination = Address(*record.source), Address(*record.destination)
            if (sender := beside.get((source, destination))) is not None:
                sender.sent(record)
            elif (receiver := beside.get((destination, source))) is not None:
                receiver.answered(record)
            else:
                result.strangers += 1
        for emulator in beside.values():
            emulator.finish()
    result.took_s = (elapsed_ns() - began_ns) / 1e9
    return result


def tell_why_not_own(header: CaptureHeader, file: Path, result: ReplayResult) -> None:
    """Note why a recording with a header of ours cannot be replayed to the byte."""
    if header.robots and any(robot.cycles_before for robot in header.robots):
        cycles = max(robot.cycles_before for robot in header.robots)
        result.note(f"the recording began {cycles} cycles after the controller did: compared, not replayed to the byte")
    elif first_and_number(file)[1] > 1:
        result.note("the first files of the ring are not there: compared, not replayed to the byte")
    else:
        result.note("the recorder's notes are not in the file: compared, not replayed to the byte")
    if any(robot.servo is not None for robot in header.station.robot):
        result.note("the servo link needs the whole recording: only FRI is compared")


_EMULATED: Final = frozenset({"mujoco", "ideal"})


def _base_config(header: CaptureHeader | None, number: int, flow: Flow, wish: Wish) -> RobotConfig:
    config = RobotConfig()
    if header is not None:
        own = [
            header.config(place)
            for place, start in enumerate(header.robots)
            if start.address(FRI_LINK) == flow.controller
        ]
        if own:
            config = own[0]
        elif number < len(header.station.robot):
            config = header.config(number)
    # The emulator beside a recording is simulated, whatever the recording was of.
    config = _simulated(config)
    return config if wish.model is None else config.model_copy(update={"model": wish.model})


def recorded_config(file: Path) -> RobotConfig:
    """Return the robot of a capture, simulated: as the capture says it was, or as its first FRI controller seems to be.

    Raises :class:`UsageError` where there is nothing to tell it from.
    """
    header = read_header(read_section_comment(file))
    if header is not None:
        return _simulated(header.config(0))
    flows = list(flows_of(file, Wish()).values())
    if not flows:
        raise UsageError(f"{file} holds no FRI traffic that is understood, and nothing says what robot it is of")
    return flows[0].config(RobotConfig(), backend=None)


def _simulated(config: RobotConfig) -> RobotConfig:
    return config if config.backend in _EMULATED else config.model_copy(update={"backend": "mujoco", "options": {}})


def flows_of(file: Path, wish: Wish) -> dict[tuple[Address, Address], Flow]:
    """Return the controllers of ``file`` with their clients; raise ``CaptureError`` where nothing can be read."""
    read_section_comment(file)
    return _looked_through(packets_of(file), wish)


def packets_of(file: Path) -> Iterator[Packet]:
    """Yield the datagrams of ``file`` and of the parts of its ring behind it, up to the first damage."""
    with suppress(CaptureError):
        for part in parts_from(file):
            for record in read_records(part):
                if isinstance(record, Packet):
                    yield record


def _looked_through(packets: Iterator[Packet], wish: Wish) -> dict[tuple[Address, Address], Flow]:
    """Look through the recording for its controllers, as far as they tell more."""
    flows: dict[tuple[Address, Address], Flow] = {}
    codecs: dict[tuple[Address, Address], FriCodec] = {}
    for looked, packet in enumerate(islice(packets, _MOST_LOOKED_AT), start=1):
        route = Address(*packet.source), Address(*packet.destination)
        flow = flows.get(route)
        if flow is None:
            if (found := flow_of(packet, wish.release)) is not None and len(flows) < _MOST_FLOWS:
                flows[route], codecs[route] = found, FriCodec(found.release)
        elif not flow.known:
            with suppress(MalformedDatagram):
                flow.look(codecs[route].decode_monitoring(packet.payload), packet.at_unix_ns)
        if looked > _LEAST_LOOKED_AT and flows and all(one.known for one in flows.values()):
            break
    return flows


def own_header(file: Path) -> CaptureHeader | None:
    """Return the header of a complete recording of ours, which can be replayed exactly; None where it is none."""
    header = read_header(read_section_comment(file))
    if header is None or not header.complete or first_and_number(file)[1] != 1 or not _has_notes(file):
        return None
    return header


def _has_notes(file: Path) -> bool:
    """Whether the recorder's notes are there: a program that copied the packets leaves them behind."""
    with suppress(CaptureError):
        return any(isinstance(record, Notes) for record in islice(read_records(file), _LEAST_LOOKED_AT))
    return True


def replay_own(
    file: Path,
    header: CaptureHeader,
    *,
    progress: ProgressTold | None = None,
    pace: Callable[[int], None] | None = None,
    update: bool = False,
    watch: Watcher | None = None,
    observe: Observe | None = None,
    finished: Callable[[ExactReplay], None] | None = None,
) -> ReplayResult:
    """Replay a complete recording of ours; with ``update`` its outputs become those of the emulator.

    ``finished`` is shown the replay when the recording is over, before its robot sides are released.
    """
    result = ReplayResult(str(file), own=True)
    recorded = header.machine.get(ARITHMETIC)
    result.other_arithmetic = recorded is not None and recorded != arithmetic_fingerprint()
    parts = parts_from(file)
    if update and len(parts) > 1:
        raise UsageError(f"{file} is a ring of {len(parts)} files; only a recording in one file can be updated")
    with ExitStack() as opened:
        rewrite = opened.enter_context(closing(_Rewrite(file, header))) if update else None
        # What is loaded by now stays: the collector need not look through it each time it looks for rubbish.
        gc.collect()
        gc.freeze()
        opened.callback(gc.unfreeze)
        began_ns = elapsed_ns()
        try:
            replay = opened.enter_context(
                closing(ExactReplay(header, result, sink=rewrite, pace=pace, watch=watch, observe=observe))
            )
        except (UsageError, BackendError) as error:
            reason = f"the controller it tells of cannot be made here: {error}"
            raise CaptureError(file, reason, offset=0) from error
        _feed(replay, parts, result, progress)
        if finished is not None:
            finished(replay)
        result.took_s = (elapsed_ns() - began_ns) / 1e9
        if rewrite is not None and not result.damage:
            rewrite.keep()
            result.updated = True
    return result


def _feed(replay: ExactReplay, parts: list[Path], result: ReplayResult, progress: ProgressTold | None) -> None:
    records = records_of(parts, result, progress)
    try:
        # Many at once: reading and the controller drive each other's code and data out of the processor's caches.
        while some := list(islice(records, _RECORDS_AT_ONCE)):
            for record in some:
                if type(record) is Packet:
                    replay.packet(record)
                elif (tick := single_tick(record.entries)) is not None:  # type: ignore[union-attr]  # the others are notes
                    replay.tick(tick)
                elif isinstance(record, Notes):
                    for entry in read_entries(record.entries):
                        replay.entry(entry)
    except JournalError as error:
        damaged = CaptureError(parts[-1], f"the recorder's notes are damaged: {error}", offset=record.offset)
        result.damage = str(damaged)
    replay.finish()


def records_of(parts: list[Path], result: ReplayResult, progress: ProgressTold | None) -> Iterator[CaptureRecord]:
    """Yield what the parts hold up to the first damage, which is told in the result."""
    whole = sum(part.stat().st_size for part in parts)
    before = 0
    began_ns = elapsed_ns()
    for part in parts:
        reader: RecordReader | None = None
        try:
            reader = read_records(part)
            if progress is None:
                yield from reader
            else:
                for count, record in enumerate(reader):
                    if count % _PROGRESS_EVERY == 0:
                        progress(before + record.offset, whole, _how_fast(result, began_ns))
                    yield record
        except CaptureError as error:
            result.damage = str(error)
            return
        finally:
            if reader is not None and reader.skipped:
                result.note(f"{reader.skipped} packets of {part} are no whole UDP datagram over IPv4: passed over")
        before += part.stat().st_size
    if progress is not None:
        progress(whole, whole, _how_fast(result, began_ns))


def _how_fast(result: ReplayResult, began_ns: int) -> str:
    took_s = (elapsed_ns() - began_ns) / 1e9
    return f"{result.reached_s:.1f} s, {result.reached_s / took_s:.1f} x real time" if took_s else ""


class _Rewrite:
    """The recording, written anew beside itself, and put into its place by :meth:`keep`, else thrown away."""

    def __init__(self, file: Path, header: CaptureHeader) -> None:
        self._file = file
        self._beside = file.with_name(f".{file.name}.{os.getpid()}.new")
        now = CaptureHeader.of_run(header.station, header.robots)
        self._writer = PcapngWriter(self._beside, comment=now.to_comment())

    def note(self, entry: Entry) -> None:
        """Take an entry of the journal."""
        self._writer.note(encode_entry(entry))

    def put(self, datagram: CapturedDatagram) -> None:
        """Take a datagram."""
        self._writer.write(datagram)

    def keep(self) -> None:
        """Put it into its place."""
        self._writer.close()
        self._beside.replace(self._file)

    def close(self) -> None:
        """Throw it away, if it was not kept."""
        with suppress(CaptureError):
            self._writer.close()
        self._beside.unlink(missing_ok=True)
