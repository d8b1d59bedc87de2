"""Everything one robot's core is told, in order, for whoever records it: enough to tell it the same again."""

import json
from typing import Protocol

from hil.runtime.pad_requests import write_action
from hil.values.link import Address
from hil.values.operator import OperatorAction
from transport.capture.journal import ActionEntry, CloseEntry, FailedEntry, encode_entry, inputs_crc32, tick_entry


class Recorder(Protocol):
    """Takes datagrams and entries of the journal for a capture; must not block."""

    def put(self, at_unix_ns: int, source: Address, destination: Address, payload: bytes) -> None:
        """Record one datagram."""

    def note(self, entry: bytes) -> None:
        """Record one entry of the journal."""


class RobotJournal:
    """Of the robot ``number`` of the run. Without a recorder it does nothing; times are the robot's core times."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._recorder: Recorder | None = None
        self._unix_epoch_ns = 0
        self._inputs_crc32 = 0

    def record_to(self, recorder: Recorder | None, *, unix_epoch_ns: int) -> None:
        """Tell ``recorder`` what comes from now on; core time 0 is ``unix_epoch_ns`` in Unix time."""
        self._recorder = recorder
        self._unix_epoch_ns = unix_epoch_ns
        self._inputs_crc32 = 0

    def received(self, payload: bytes, source: Address, destination: Address, *, at_ns: int) -> None:
        """A datagram was handed to the core."""
        if self._recorder is not None:
            self._recorder.put(self._unix_epoch_ns + at_ns, source, destination, payload)
            self._inputs_crc32 = inputs_crc32(payload, at_ns, self._inputs_crc32)

    def ticked(self, *, due_ns: int, lateness_ns: int, departed_ns: int) -> None:
        """A cycle ran; what it has to send follows."""
        if self._recorder is not None:
            self._recorder.note(
                tick_entry(
                    self._number,
                    due_ns=due_ns,
                    lateness_ns=lateness_ns,
                    departed_ns=departed_ns,
                    inputs_crc32=self._inputs_crc32,
                )
            )
            self._inputs_crc32 = 0

    def sent(self, payload: bytes, source: Address, destination: Address, *, at_ns: int) -> None:
        """The core had a datagram to send."""
        if self._recorder is not None:
            self._recorder.put(self._unix_epoch_ns + at_ns, source, destination, payload)

    def operated(self, action: OperatorAction, *, at_ns: int) -> None:
        """The operator did something."""
        if self._recorder is not None:
            text = json.dumps(write_action(action))
            self._recorder.note(encode_entry(ActionEntry(self._number, at_ns, text)))

    def closed(self, *, at_ns: int) -> None:
        """The core was asked to end."""
        if self._recorder is not None:
            self._recorder.note(encode_entry(CloseEntry(self._number, at_ns)))

    def failed(self, reason: str, *, at_ns: int) -> None:
        """The robot side failed."""
        if self._recorder is not None:
            self._recorder.note(encode_entry(FailedEntry(self._number, at_ns, reason)))
