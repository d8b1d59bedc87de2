"""A recorder for virtual time: it writes at once, because nobody waits for it."""

from collections.abc import Mapping
from pathlib import Path

from hil.config.station import RobotConfig, Station
from hil.runtime.capture_header import CaptureHeader, RobotStart
from hil.runtime.journal import RobotJournal
from hil.values.link import Address
from transport.capture.journal import EndEntry, encode_entry
from transport.capture.records import CapturedDatagram
from transport.capture.writing import PcapngWriter


class FileRecorder:
    """Writes the recording of the run of ``header`` to ``file``; raises ``CaptureError`` for what the system refuses.

    :meth:`close` completes it.
    """

    def __init__(self, file: Path, header: CaptureHeader) -> None:
        self._writer = PcapngWriter(file, comment=header.to_comment())

    def put(self, at_unix_ns: int, source: Address, destination: Address, payload: bytes) -> None:
        """Record one datagram."""
        self._writer.write(CapturedDatagram(at_unix_ns, source, destination, payload))

    def note(self, entry: bytes) -> None:
        """Record one entry of the journal."""
        self._writer.note(entry)

    def close(self) -> None:
        """Complete the file."""
        self._writer.note(encode_entry(EndEntry()))
        self._writer.close()


def record_one_robot(
    journal: RobotJournal,
    file: Path,
    config: RobotConfig,
    *,
    unix_epoch_ns: int,
    fri_peer: Address | None,
    bound: Mapping[str, Address],
    token_secret: bytes,
) -> FileRecorder:
    """Record the run of ``config``, which begins now, to ``file`` by way of ``journal``; raise ``CaptureError``.

    ``bound`` is where each link is served from; core time 0 is ``unix_epoch_ns`` in Unix time.
    """
    start = RobotStart(
        name=config.name,
        unix_epoch_ns=unix_epoch_ns,
        fri_peer=fri_peer,
        bound=dict(bound),
        token_secret=token_secret.hex(),
    )
    recorder = FileRecorder(file, CaptureHeader.of_run(Station(robot=[config]), (start,)))
    journal.record_to(recorder, unix_epoch_ns=unix_epoch_ns)
    return recorder
