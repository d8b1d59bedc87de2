"""Replays a capture file: as what it is, with progress and pace."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

from hil.arithmetic import arithmetic_fingerprint
from hil.clock import elapsed_ns
from hil.replay.exact import ExactReplay
from hil.replay.header import ARITHMETIC, CaptureHeader, read_header
from hil.replay.result import ReplayResult
from hil.values.errors import UsageError
from transport.capture.errors import CaptureError
from transport.capture.journal import Entry, encode_entry, read_entries
from transport.capture.parts import first_and_number, parts_from
from transport.capture.reading import RecordReader, read_records, read_section_comment
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes
from transport.capture.writing import PcapngWriter

_PROGRESS_EVERY: Final = 2000

Progress = Callable[[int, int, float], None]
"""Told bytes read, bytes in all, and seconds of the recording."""


def replay_file(
    file: Path, *, progress: Progress | None = None, pace: Callable[[int], None] | None = None, update: bool = False
) -> ReplayResult:
    """Replay ``file``, with the parts of its ring behind it; raise ``CaptureError`` only where nothing can be read."""
    header = read_header(read_section_comment(file))
    if header is None or not header.complete or first_and_number(file)[1] > 1:
        raise UsageError(f"{file} is no complete recording of fri-hil")
    return replay_own(file, header, progress=progress, pace=pace, update=update)


def replay_own(
    file: Path,
    header: CaptureHeader,
    *,
    progress: Progress | None = None,
    pace: Callable[[int], None] | None = None,
    update: bool = False,
) -> ReplayResult:
    """Replay a complete recording of ours; with ``update`` its outputs become those of the emulator."""
    result = ReplayResult(str(file), own=True)
    recorded = header.machine.get(ARITHMETIC)
    result.other_arithmetic = recorded is not None and recorded != arithmetic_fingerprint()
    parts = parts_from(file)
    if update and len(parts) > 1:
        raise UsageError(f"{file} is a ring of {len(parts)} files; only a recording in one file can be updated")
    rewrite = _Rewrite(file, header) if update else None
    began_ns = elapsed_ns()
    with closing(ExactReplay(header, result, sink=rewrite, pace=pace)) as replay:
        _feed(replay, parts, result, progress)
    result.took_s = (elapsed_ns() - began_ns) / 1e9
    if rewrite is not None:
        result.updated = rewrite.end(keep=not result.damage)
    return result


def _feed(replay: ExactReplay, parts: list[Path], result: ReplayResult, progress: Progress | None) -> None:
    for record in _records(parts, result, progress):
        if isinstance(record, Notes):
            try:
                for entry in read_entries(record.entries):
                    replay.entry(entry)
            except ValueError as error:
                damaged = CaptureError(parts[-1], f"the recorder's notes are damaged: {error}", offset=record.offset)
                result.damage = str(damaged)
                break
        else:
            replay.packet(record)
    replay.finish()


def _records(parts: list[Path], result: ReplayResult, progress: Progress | None) -> Iterator[CaptureRecord]:
    """Yield what the parts hold up to the first damage, which is told in the result."""
    whole = sum(part.stat().st_size for part in parts)
    before = 0
    for part in parts:
        reader: RecordReader | None = None
        try:
            reader = read_records(part)
            for count, record in enumerate(reader):
                if progress is not None and count % _PROGRESS_EVERY == 0:
                    progress(before + reader.read_bytes, whole, result.recorded_s)
                yield record
        except CaptureError as error:
            result.damage = str(error)
            return
        finally:
            if reader is not None and reader.skipped:
                result.note(f"{reader.skipped} packets of {part} are no whole UDP datagram over IPv4: passed over")
        before += part.stat().st_size
    if progress is not None:
        progress(whole, whole, result.recorded_s)


class _Rewrite:
    """The recording, written anew beside itself, and put into its place at the end."""

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

    def end(self, *, keep: bool) -> bool:
        """Put it into its place, or throw it away; return whether it is there."""
        self._writer.close()
        if keep:
            self._beside.replace(self._file)
        else:
            self._beside.unlink()
        return keep
