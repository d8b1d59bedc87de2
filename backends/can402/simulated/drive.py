"""One simulated drive: frames in, frames out; an SDO server, the state machine, process data as they were mapped.

Follows its target exactly, from one SYNC to the next. Torque: what accelerates a rotor of ``INERTIA_KG_M2``, and turns
it against ``FRICTION_NM_S``, both rough, so that there is a sign to be tested. Not modelled: load, gravity, current.
"""

import struct
from enum import StrEnum
from typing import Final

from backends.can402 import objects
from backends.can402.state_machine import PowerState, power_state
from backends.can402.wire import Frame

VENDOR: Final = 0x00F61
PRODUCT: Final = 0x402
COUNTS_PER_RAD: Final = (1 << 20) * 100.0 / 6.283185307179586
RATED_NM: Final = 100.0
INERTIA_KG_M2: Final = 1.0
FRICTION_NM_S: Final = 2.0
FOLLOWING_ERROR: Final = 0x8611
HEARTBEAT_MISSED: Final = 0x8130
_FOLLOWING_COUNTS: Final = int(0.2 * COUNTS_PER_RAD)
_STATUS: Final = {
    PowerState.DISABLED: 0x40,
    PowerState.READY: 0x21,
    PowerState.SWITCHED_ON: 0x23,
    PowerState.ENABLED: 0x27,
    PowerState.QUICK_STOP: 0x07,
    PowerState.FAULT: 0x08,
}
_P = PowerState
_TRANSITIONS: Final = {
    (_P.DISABLED, 0x06): _P.READY,
    (_P.READY, 0x07): _P.SWITCHED_ON,
    (_P.READY, 0x0F): _P.SWITCHED_ON,
    (_P.SWITCHED_ON, 0x0F): _P.ENABLED,
    (_P.SWITCHED_ON, 0x06): _P.READY,
    (_P.ENABLED, 0x07): _P.SWITCHED_ON,
    (_P.ENABLED, 0x06): _P.READY,
    (_P.ENABLED, 0x02): _P.QUICK_STOP,
    **{(state, 0x00): _P.DISABLED for state in (_P.READY, _P.SWITCHED_ON, _P.ENABLED, _P.QUICK_STOP)},
    **{(state, 0x02): _P.DISABLED for state in (_P.READY, _P.SWITCHED_ON)},
}
"""Where a control word leads; what is not there leads nowhere."""
QUICK_STOP_NS: Final = 20_000_000
"""From the quick stop to the brakes, when a drive is disabled by itself; the axis itself stops at once here."""
_PRE_OPERATIONAL: Final = 127
_OPERATIONAL: Final = 5
_NO_OBJECT: Final = 0x06020000


class DriveFault(StrEnum):
    """What can be made to go wrong."""

    LOST = "lost"
    """It says nothing and hears nothing."""
    BOOT = "boot"
    """It starts anew, as after a dip of its supply."""
    IDENTITY = "identity"
    """It is another product."""
    NO_402 = "no-402"
    """It is no CiA 402 drive."""
    OTHER_NODE = "other-node"
    """Its answers carry the number of the next node."""
    STRANGER = "stranger"
    """Its answers carry a number that no drive of the station has."""
    NO_HEARTBEAT = "no-heartbeat"
    """It knows node guarding only."""
    OTHER_SDO = "other-sdo"
    """It answers what it is asked with the number of the next node."""
    STUCK = "stuck"
    """It never leaves switch on disabled."""


class SimulatedDrive:
    """A drive with node number ``node`` that stands at ``counts``."""

    def __init__(self, node: int, *, counts: int = 0) -> None:
        self.node = node
        self.counts = counts
        self.counts_per_s = 0
        self.torque_permille = 0
        self.state = PowerState.DISABLED
        self.error_code = 0
        self.faults: set[DriveFault] = set()
        self.target = counts
        self._control = 0
        self._next: tuple[int, int] | None = None
        self._nmt = _PRE_OPERATIONAL
        self._toggle = 0
        self._objects: dict[tuple[int, int], bytes] = {}
        self._beat_ns = 0
        self._stopping_ns = 0
        self._missed_ns: int | None = None
        """Since the last heartbeat of who is watched; None before the first one."""
        self._boot()

    @property
    def period_ns(self) -> int:
        """Time from SYNC to SYNC that it was told; 1 ms before that."""
        return self._objects[objects.INTERPOLATION_TIME, 1][0] * 1_000_000

    @property
    def operational(self) -> bool:
        """Whether it exchanges process data."""
        return self._nmt == _OPERATIONAL

    def fail(self, code: int) -> list[Frame]:
        """Go to fault with an error code; return the emergency message."""
        self.state, self.error_code, self.counts_per_s = PowerState.FAULT, code, 0
        if DriveFault.LOST in self.faults:
            return []
        return [Frame(objects.SYNC_COB + self.node, struct.pack("<HB5x", code, 1))]

    def boot(self) -> list[Frame]:
        """Start anew; return the boot-up message."""
        self._boot()
        self.state, self.error_code, self.counts_per_s = PowerState.DISABLED, 0, 0
        return [Frame(objects.HEARTBEAT_COB + self.node, b"\0")]

    def passed(self, duration_ns: int) -> list[Frame]:
        """Let time pass; return the heartbeat if one is due, and what it makes of one that is missing."""
        self._stopping_ns = self._stopping_ns + duration_ns if self.state is PowerState.QUICK_STOP else 0
        if self._stopping_ns >= QUICK_STOP_NS:
            self.state = PowerState.DISABLED
        return self._watch(duration_ns) + self._beat(duration_ns)

    def _watch(self, duration_ns: int) -> list[Frame]:
        watched = struct.unpack("<I", self._objects[objects.CONSUMER_HEARTBEAT, 1])[0]
        if self._missed_ns is None or not watched:
            return []
        self._missed_ns += duration_ns
        if self._missed_ns <= (watched & 0xFFFF) * 1_000_000 or self.state is PowerState.FAULT:
            return []
        return self.fail(HEARTBEAT_MISSED)

    def _beat(self, duration_ns: int) -> list[Frame]:
        period_ns = struct.unpack("<H", self._objects.get((objects.PRODUCER_HEARTBEAT, 0), b"\0\0"))[0] * 1_000_000
        if not period_ns or DriveFault.LOST in self.faults:
            return []
        self._beat_ns += duration_ns
        if self._beat_ns < period_ns:
            return []
        self._beat_ns = 0
        return [Frame(objects.HEARTBEAT_COB + self.node, bytes([self._nmt]))]

    def receive(self, frame: Frame, *, period_ns: int) -> list[Frame]:
        """Take one frame of the bus; return what the drive answers."""
        if DriveFault.LOST in self.faults:
            return []
        identifier = frame.identifier
        if identifier == 0:
            self._manage(frame.data)
        elif identifier == 0x600 + self.node:
            return [Frame(0x580 + self.node + (DriveFault.OTHER_SDO in self.faults), self._serve(frame.data))]
        elif identifier == objects.HEARTBEAT_COB + (self._objects[objects.CONSUMER_HEARTBEAT, 1][2] or 128):
            self._missed_ns = 0
        elif identifier == objects.HEARTBEAT_COB + self.node and frame.remote:
            self._toggle ^= 0x80
            return [Frame(identifier, bytes([self._nmt | self._toggle]))]
        elif self._nmt == _OPERATIONAL and identifier == objects.SYNC_COB:
            return self._synchronise(period_ns)
        elif self._nmt == _OPERATIONAL and identifier == self._cob(objects.RPDO):
            self._command(frame.data)
        return []

    def _boot(self) -> None:
        self._nmt, self._missed_ns = _PRE_OPERATIONAL, None
        product = PRODUCT + (DriveFault.IDENTITY in self.faults)
        profile = objects.PROFILE_402 - (DriveFault.NO_402 in self.faults)
        self._objects = {
            (objects.DEVICE_TYPE, 0): struct.pack("<I", 0x20000 | profile),
            (objects.IDENTITY, 1): struct.pack("<I", VENDOR),
            (objects.IDENTITY, 2): struct.pack("<I", product),
            (objects.SUPPORTED_MODES, 0): struct.pack("<I", 1 << 7),
            (objects.MODE, 0): b"\0",
            (objects.INTERPOLATION_TIME, 1): b"\1",
            (objects.INTERPOLATION_TIME, 2): b"\xfd",
            (objects.CONSUMER_HEARTBEAT, 1): bytes(4),
            (objects.PRODUCER_HEARTBEAT, 0): bytes(2),
            (objects.SYNC_ID, 0): struct.pack("<I", objects.SYNC_COB),
            (objects.SYNC_PERIOD, 0): bytes(4),
            (objects.QUICK_STOP_OPTION, 0): struct.pack("<h", 2),
            (objects.GUARD_TIME, 0): bytes(2),
            (objects.LIFE_TIME, 0): bytes(1),
        }
        for communication, mapping, content in (
            (objects.RPDO, objects.RPDO_MAPPING, objects.COMMANDS),
            (objects.TPDO, objects.TPDO_MAPPING, objects.ANSWERS),
        ):
            for offset in range(len(content)):
                self._objects[communication + offset, 1] = struct.pack("<I", objects.PDO_OFF)
                self._objects[communication + offset, 2] = b"\xff"
                self._objects[mapping + offset, 0] = b"\0"
                for position in range(1, 5):
                    self._objects[mapping + offset, position] = bytes(4)

    def _manage(self, data: bytes) -> None:
        if len(data) != 2 or data[1] not in {0, self.node}:
            return
        if data[0] == 0x01:
            self._nmt = _OPERATIONAL
        elif data[0] == 0x80:
            self._nmt = _PRE_OPERATIONAL
            if self.state is PowerState.ENABLED:
                self.state, self.counts_per_s = PowerState.DISABLED, 0

    def _serve(self, request: bytes) -> bytes:
        command, index, sub = struct.unpack_from("<BHB", request.ljust(8, b"\0"))
        value = self._value(index, sub)
        if value is None or (index == objects.PRODUCER_HEARTBEAT and DriveFault.NO_HEARTBEAT in self.faults):
            return struct.pack("<BHBI", 0x80, index, sub, _NO_OBJECT)
        if command >> 5 == 2:
            return struct.pack("<BHB", 0x43 | (4 - len(value)) << 2, index, sub) + value.ljust(4, b"\0")
        if command >> 5 == 1 and command & 0x2:
            size = 4 - (command >> 2 & 3) if command & 1 else 4
            if size != len(value):
                return struct.pack("<BHBI", 0x80, index, sub, 0x06070010)
            self._objects[index, sub] = request[4 : 4 + size]
            return struct.pack("<BHB4x", 0x60, index, sub)
        return struct.pack("<BHBI", 0x80, index, sub, 0x05040001)

    def _value(self, index: int, sub: int) -> bytes | None:
        live = {
            (objects.STATUS_WORD, 0): lambda: struct.pack("<H", _STATUS[self.state]),
            (objects.MODE_DISPLAY, 0): lambda: self._objects[objects.MODE, 0],
            (objects.ACTUAL_POSITION, 0): lambda: struct.pack("<i", self.counts),
            (objects.ACTUAL_VELOCITY, 0): lambda: struct.pack("<i", self.counts_per_s),
            (objects.ACTUAL_TORQUE, 0): lambda: struct.pack("<h", self.torque_permille),
            (objects.ERROR_CODE, 0): lambda: struct.pack("<H", self.error_code),
        }.get((index, sub))
        return self._objects.get((index, sub)) if live is None else live()

    def _cob(self, index: int) -> int:
        return int(struct.unpack("<I", self._objects[index, 1])[0])

    def _mapped(self, mapping: int) -> list[tuple[int, int]]:
        count = self._objects[mapping, 0][0]
        entries = [struct.unpack("<I", self._objects[mapping, place])[0] for place in range(1, count + 1)]
        return [(entry >> 16, (entry & 0xFF) // 8) for entry in entries]

    def _command(self, data: bytes) -> None:
        control, target, at = self._control, self.target, 0
        for index, size in self._mapped(objects.RPDO_MAPPING):
            value = int.from_bytes(data[at : at + size], "little", signed=index == objects.TARGET_POSITION)
            at += size
            if index == objects.CONTROL_WORD:
                control = value
            elif index == objects.TARGET_POSITION:
                target = value
        self._next = control, target

    def _synchronise(self, period_ns: int) -> list[Frame]:
        """What was measured goes out, what was commanded since the last SYNC counts from now on."""
        self._move(period_ns)
        frames = []
        for offset in range(2):
            cob = self._cob(objects.TPDO + offset)
            if cob & objects.PDO_OFF:
                continue
            parts = [
                self._value(index, 0) or bytes(size) for index, size in self._mapped(objects.TPDO_MAPPING + offset)
            ]
            frames.append(Frame(self._numbered(cob), b"".join(parts)))
        if self._next is not None:
            control, self.target = self._next
            self._next = None
            frames += self._obey(control)
        return frames

    def _move(self, period_ns: int) -> None:
        wanted = self.target if self.state is PowerState.ENABLED else self.counts
        before, self.counts_per_s = self.counts_per_s, round((wanted - self.counts) * 1e9 / period_ns)
        self.counts = wanted
        speed = self.counts_per_s / COUNTS_PER_RAD
        change = (self.counts_per_s - before) / COUNTS_PER_RAD * 1e9 / period_ns
        torque = (INERTIA_KG_M2 * change + FRICTION_NM_S * speed) / RATED_NM * 1e3
        self.torque_permille = max(-32768, min(32767, round(torque)))

    def _obey(self, control: int) -> list[Frame]:
        rising = control & 0x80 and not self._control & 0x80
        self._control = control
        if self.state is PowerState.FAULT:
            if rising:
                self.state, self.error_code = PowerState.DISABLED, 0
            return []
        if DriveFault.STUCK not in self.faults:
            self.state = _TRANSITIONS.get((self.state, control & 0x0F), self.state)
        if self.state is PowerState.ENABLED and abs(self.target - self.counts) > _FOLLOWING_COUNTS:
            return self.fail(FOLLOWING_ERROR)
        return []

    def _numbered(self, cob: int) -> int:
        if DriveFault.OTHER_NODE in self.faults:
            return cob + 1
        return (cob & ~0x7F) + 99 if DriveFault.STRANGER in self.faults else cob


assert all(power_state(word) is state for state, word in _STATUS.items())  # noqa: S101  # a table that belies itself
