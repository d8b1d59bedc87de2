"""The CAN bus as this backend needs it: frames out, what has come, and bounded waits; no thread, no clock."""

from typing import Final, NamedTuple

import can

from backends.can402.options import Can402Options
from hil.values.errors import BackendError

MOST_FRAMES_AT_ONCE: Final = 512
"""Frames that are read in one go; a bus that carries more than that in a cycle is not ours alone."""
MOST_ERROR_FRAMES: Final = 16
"""Between two checks. One is repeated by the controllers themselves; so many are a disturbed bus. Ours."""
_BUS_OFF_ERROR: Final = 0x40
"""In the identifier of an error frame (linux/can/error.h)."""
_SERIAL_LINE: Final = {"timeout": 0.0}
"""For slcan, whose reads would else wait a millisecond for a byte."""


BUS_OFF: Final = "the CAN controller is bus-off: too many errors on the bus; look at cable, ends and bit rate"


class Frame(NamedTuple):
    """A data frame with an 11-bit identifier; ``remote``: one that asks for it."""

    identifier: int
    data: bytes
    remote: bool = False


class BusFailed(BackendError):
    """The bus does not work any more."""


class Wire:
    """One open bus. ``close`` is idempotent. Everything raises :class:`BusFailed` when the bus fails."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus: can.BusABC | None = bus
        self.at_s = 0.0
        """When the frame that was received last came, by the time stamps of the bus."""
        self._error_frames = 0

    def send(self, frame: Frame) -> None:
        """Send a frame."""
        message = can.Message(
            arbitration_id=frame.identifier, data=frame.data, is_extended_id=False, is_remote_frame=frame.remote
        )
        try:
            self._open_bus().send(message)
        except (can.CanError, OSError) as error:
            raise BusFailed(f"the CAN bus takes no frames: {error}") from error

    def receive(self, wait_s: float = 0.0) -> Frame | None:
        """Return the next data frame, None when none has come after ``wait_s``."""
        for _ in range(MOST_FRAMES_AT_ONCE):
            try:
                message = self._open_bus().recv(timeout=wait_s)
            except (can.CanError, OSError) as error:
                raise BusFailed(f"the CAN bus cannot be read: {error}") from error
            if message is None:
                return None
            if message.is_error_frame:
                self._note_error_frame(message.arbitration_id)
            elif not message.is_extended_id:
                self.at_s = message.timestamp
                return Frame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
        return None

    def check(self) -> None:
        """Raise :class:`BusFailed` for a controller that is off the bus; error frames are counted from here anew."""
        self._error_frames = 0
        try:
            state = self._open_bus().state
        except NotImplementedError:
            return  # an interface that does not tell
        if state is can.BusState.ERROR:
            raise BusFailed(BUS_OFF)

    def close(self) -> None:
        """Release the bus."""
        bus, self.bus = self.bus, None
        if bus is not None:
            bus.shutdown()

    def _note_error_frame(self, identifier: int) -> None:
        self._error_frames += 1
        if identifier & _BUS_OFF_ERROR:
            raise BusFailed(BUS_OFF)
        if self._error_frames > MOST_ERROR_FRAMES:
            raise BusFailed(
                f"the CAN bus is disturbed: {self._error_frames} error frames; look at cable, ends and bit rate"
            )

    def _open_bus(self) -> can.BusABC:
        if self.bus is None:
            raise BusFailed("the CAN bus is closed")
        return self.bus


def open_wire(options: Can402Options, *, never_blocks: bool = True) -> Wire:
    """Open the bus; raise :class:`BackendError` in one sentence.

    A bus that ``never_blocks`` has no waits of its own in reading, at the price of a busy wait where one is asked for.
    """
    where = f"the CAN bus {options.channel!r} of the interface {options.interface!r}"
    try:
        extra = _SERIAL_LINE if never_blocks and options.interface == "slcan" else {}
        return Wire(can.Bus(interface=options.interface, channel=options.channel, bitrate=options.bitrate, **extra))
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
        detail = str(error).strip().splitlines()
        raise BackendError(f"cannot open {where}: {detail[-1] if detail else type(error).__name__}") from error
