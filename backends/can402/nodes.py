"""Setting up the drives, by canopen's SDO client, before anything moves; every wait is bounded."""

import logging
import struct
from collections.abc import Callable
from typing import Any, Final

import canopen
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from backends.can402 import objects
from backends.can402.objects import ANSWERS, COMMANDS
from backends.can402.options import Can402Options
from backends.can402.wire import Frame, Wire
from hil.values.errors import BackendError, ConfigurationError
from hil.values.robot import JOINT_NAMES

ANSWER_S: Final = 0.3
"""How long a drive may take to answer an SDO request."""
_MOST_FRAMES: Final = 8_000
"""While one answer is waited for: more than the fastest bus carries in that time."""
_SDO_ANSWER: Final = 0x580
_SDO_BYTES: Final = 8
_NO_SUCH_OBJECT: Final = (0x06020000, 0x06090011)
"""Abort codes: no such object, no such subindex."""
_SLOW_DOWN_AND_SWITCH_OFF: Final = 2
_ENTER_PRE_OPERATIONAL: Final = 0x80
_START: Final = 0x01
_LIFE_FACTOR: Final = 3
_LATEST_HEARTBEATS: Final = 3

logging.getLogger("canopen").setLevel(logging.CRITICAL)


class _Client(SdoClient):  # type: ignore[misc]  # canopen has no types
    """canopen's client waits for a thread to bring the answer; this one looks for it itself."""

    RESPONSE_TIMEOUT = ANSWER_S
    MAX_RETRIES = 1

    def __init__(self, *arguments: Any, wire: Wire) -> None:
        super().__init__(*arguments)
        self._wire = wire

    def read_response(self) -> Any:
        """Return the answer; raise what canopen raises."""
        wire, others = self._wire, ""
        began_s: float | None = None
        for _ in range(_MOST_FRAMES):
            frame = wire.receive(wait_s=ANSWER_S)
            if frame is None:
                break
            # What others say must not prolong the wait for ever; only the bus tells the time here.
            began_s = wire.at_s if began_s is None else began_s
            if wire.at_s - began_s > ANSWER_S:
                break
            # Not by canopen's network, which would take what others say too, and trip over what is malformed.
            if frame.identifier == self.tx_cobid and len(frame.data) == _SDO_BYTES:
                self.on_response(frame.identifier, frame.data, 0.0)
                return super().read_response()
            if frame.identifier & ~0x7F == _SDO_ANSWER:
                others = f"; what came was an answer of node {frame.identifier & 0x7F}"
        raise NoAnswer(others)

    def abort(self, _abort_code: int = 0) -> None:
        """Say nothing: what is given up here ends the opening, or the acknowledgement, with an error of ours."""


class NoAnswer(SdoCommunicationError):  # type: ignore[misc]  # canopen has no types
    """Nothing came from the drive that was asked; its text says what came from others."""


class _Network(canopen.Network):  # type: ignore[misc]  # canopen has no types
    """Sends by our wire, so that a bus that fails is told as one."""

    def __init__(self, wire: Wire) -> None:
        super().__init__()
        self._wire = wire

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise :class:`BusFailed`."""
        self._wire.send(Frame(can_id, bytes(data), remote))


class _Node(canopen.RemoteNode):  # type: ignore[misc]  # canopen has no types
    def __init__(self, number: int, dictionary: Any, wire: Wire) -> None:
        self._wire = wire
        super().__init__(number, dictionary)

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> _Client:
        """Return a client that looks for its answers itself."""
        client = _Client(rx_cobid, tx_cobid, self.object_dictionary, wire=self._wire)
        self.sdo_channels.append(client)
        return client


class Nodes:
    """The seven drives, as far as they are set up."""

    def __init__(self, options: Can402Options, wire: Wire, *, period_ns: int) -> None:
        self._options = options
        self._period_ns = period_ns
        self._dictionary = _dictionary(options)
        self._wire = wire
        self._network = _Network(wire)
        self._nodes: list[Any] = []
        for number in options.nodes:
            node = _Node(number, self._dictionary, wire)
            self._network.add_node(node)
            self._nodes.append(node)
        self.guarded: set[int] = set()
        """Places of the drives without a heartbeat, which are asked instead."""

    def set_up(self, place: int) -> tuple[int, int]:
        """Set up one drive, not to move; return its status word and its actual position in counts.

        Raises :class:`BackendError` that names node and object.
        """
        self._network.send_message(0, bytes([_ENTER_PRE_OPERATIONAL, self._options.nodes[place]]))
        self._check_identity(place)
        self._check_modes(place)
        self._set_supervision(place)
        self._set_process_data(place)
        write = self._write
        self._write_if_there(place, objects.SYNC_ID, struct.pack("<I", objects.SYNC_COB))
        self._write_if_there(place, objects.SYNC_PERIOD, struct.pack("<I", self._period_ns // 1_000))
        self._write_if_there(place, objects.QUICK_STOP_OPTION, struct.pack("<h", _SLOW_DOWN_AND_SWITCH_OFF))
        write(place, objects.MODE, 0, struct.pack("<b", objects.CYCLIC_SYNCHRONOUS_POSITION))
        write(place, objects.INTERPOLATION_TIME, 1, struct.pack("<B", self._period_ns // 1_000_000))
        write(place, objects.INTERPOLATION_TIME, 2, struct.pack("<b", -3))
        shown = self._read(place, objects.MODE_DISPLAY, 0, "<b")
        if shown != objects.CYCLIC_SYNCHRONOUS_POSITION:
            raise BackendError(
                f"{self._name(place)} shows mode {shown} after it was set to "
                f"{objects.CYCLIC_SYNCHRONOUS_POSITION} (cyclic synchronous position)"
            )
        return self._read(place, objects.STATUS_WORD, 0, "<H"), self._read(place, objects.ACTUAL_POSITION, 0, "<i")

    def start(self, place: int) -> None:
        """Let one drive exchange process data."""
        self._network.send_message(0, bytes([_START, self._options.nodes[place]]))

    def release(self) -> None:
        """Let all drives return to pre-operational, where they exchange nothing and miss nobody; waits for nothing."""
        for place, number in enumerate(self._options.nodes):
            self._network.send_message(0, bytes([_ENTER_PRE_OPERATIONAL, number]))
            if place in self.guarded:
                self._send_write(number, objects.LIFE_TIME, 0, b"\0")
            else:
                self._send_write(number, objects.CONSUMER_HEARTBEAT, 1, bytes(4))

    def _check_identity(self, place: int) -> None:
        device_type = self._read(place, objects.DEVICE_TYPE, 0, "<I")
        if device_type & 0xFFFF != objects.PROFILE_402:
            raise BackendError(
                f"{self._name(place)} is no CiA 402 drive: its device type (1000h) is 0x{device_type:08X}, "
                f"the low 16 bits of which must be {objects.PROFILE_402}"
            )
        told = _identity_in(self._dictionary)
        for sub, name in ((1, "vendor"), (2, "product code")):
            wanted = told.get(sub)
            found = self._read(place, objects.IDENTITY, sub, "<I")
            if wanted is not None and found != wanted:
                raise BackendError(
                    f"{self._name(place)} is another drive than the EDS file describes: its {name} (1018h) is "
                    f"0x{found:08X}, the file says 0x{wanted:08X}"
                )

    def _check_modes(self, place: int) -> None:
        supported = self._read(place, objects.SUPPORTED_MODES, 0, "<I")
        if not supported >> (objects.CYCLIC_SYNCHRONOUS_POSITION - 1) & 1:
            raise BackendError(
                f"{self._name(place)} has no cyclic synchronous position mode: its modes (6502h) are 0x{supported:X}"
            )

    def _set_supervision(self, place: int) -> None:
        period_ms = self._options.heartbeat_ms
        if not self._write_if_there(place, objects.PRODUCER_HEARTBEAT, struct.pack("<H", period_ms)):
            self.guarded.add(place)
            self._write(place, objects.GUARD_TIME, 0, struct.pack("<H", period_ms))
            self._write(place, objects.LIFE_TIME, 0, struct.pack("<B", _LIFE_FACTOR))
            return
        watched = objects.OUR_NODE << 16 | _LATEST_HEARTBEATS * period_ms
        self._write(place, objects.CONSUMER_HEARTBEAT, 1, struct.pack("<I", watched))

    def _set_process_data(self, place: int) -> None:
        number = self._options.nodes[place]
        for communication, mapping, content in (
            (objects.RPDO, objects.RPDO_MAPPING, COMMANDS),
            (objects.TPDO, objects.TPDO_MAPPING, ANSWERS),
        ):
            for offset, (identifier, parts) in enumerate(content.items()):
                cob = struct.pack("<I", identifier + number | objects.PDO_OFF)
                self._write(place, communication + offset, 1, cob)
                self._write(place, communication + offset, 2, struct.pack("<B", objects.EVERY_SYNC))
                self._write(place, mapping + offset, 0, b"\0")
                for position, part in enumerate(parts, start=1):
                    self._write(place, mapping + offset, position, struct.pack("<I", part.entry))
                self._write(place, mapping + offset, 0, struct.pack("<B", len(parts)))
                self._write(place, communication + offset, 1, struct.pack("<I", identifier + number))

        for index in (objects.TPDO + 2, objects.TPDO + 3):
            # A drive may come with more of them, which nobody counted among what the bus carries.
            unused = 0x180 + 0x100 * (index - objects.TPDO) + number | objects.PDO_OFF
            self._write_if_there(place, index, struct.pack("<I", unused), sub=1)

    def _send_write(self, number: int, index: int, sub: int, data: bytes) -> None:
        """Write up to four bytes, and do not look what becomes of it."""
        command = 0x23 | (4 - len(data)) << 2
        request = struct.pack("<BHB", command, index, sub) + data.ljust(4, b"\0")
        self._network.send_message(0x600 + number, request)

    def _write_if_there(self, place: int, index: int, data: bytes, *, sub: int = 0) -> bool:
        """Write an object that a drive need not have; return whether it has it."""
        try:
            self._nodes[place].sdo.download(index, sub, data)
        except SdoAbortedError as error:
            if error.code not in _NO_SUCH_OBJECT:
                raise self._failed(place, index, sub, error) from error
            return False
        except SdoError as error:
            raise self._failed(place, index, sub, error) from error
        return True

    def _write(self, place: int, index: int, sub: int, data: bytes) -> None:
        self._asked(place, index, sub, lambda: self._nodes[place].sdo.download(index, sub, data))

    def _read(self, place: int, index: int, sub: int, layout: str) -> int:
        data = self._asked(place, index, sub, lambda: self._nodes[place].sdo.upload(index, sub))
        size = struct.calcsize(layout)
        if len(data) < size:
            raise BackendError(f"{self._name(place)} answers {index:04X}h:{sub} with {len(data)} bytes, not {size}")
        value: int = struct.unpack(layout, data[:size])[0]
        return value

    def _asked(self, place: int, index: int, sub: int, ask: Callable[[], Any]) -> Any:
        try:
            return ask()
        except SdoError as error:
            raise self._failed(place, index, sub, error) from error

    def _failed(self, place: int, index: int, sub: int, error: Exception) -> BackendError:
        if isinstance(error, NoAnswer):
            return BackendError(
                f"{self._name(place)} does not answer (object {index:04X}h:{sub}) within {ANSWER_S:g} s: is it there, "
                f"powered, and set to that number and bit rate?{error}"
            )
        if isinstance(error, SdoCommunicationError):
            return BackendError(
                f"{self._name(place)} answers out of turn (object {index:04X}h:{sub}): do two drives have that number?"
            )
        return BackendError(f"{self._name(place)} refuses object {index:04X}h:{sub}: {error}")

    def _name(self, place: int) -> str:
        return f"node {self._options.nodes[place]} ({JOINT_NAMES[place]})"


def _dictionary(options: Can402Options) -> Any:
    from backends.can402.simulated import EDS

    path = EDS if options.simulated and options.eds is None else options.eds
    if path is None:
        return canopen.ObjectDictionary()
    try:
        dictionary = canopen.import_od(str(path))
    except OSError as error:
        raise ConfigurationError(f"cannot read the EDS file {path}: {error.strerror}") from error
    except Exception as error:
        raise ConfigurationError(f"{path} is no EDS file that can be read: {error}") from error
    missing = next((index for index in objects.NEEDED if index not in dictionary), None)
    if missing is not None:
        raise ConfigurationError(f"{path} describes no drive for this backend: it has no object {missing:04X}h")
    return dictionary


def _identity_in(dictionary: Any) -> dict[int, int]:
    if objects.IDENTITY not in dictionary:
        return {}
    record = dictionary[objects.IDENTITY]
    return {sub: record[sub].default for sub in (1, 2) if sub in record and record[sub].default is not None}
