"""Where a capture was taken, as far as the frames tell.

A machine's own datagrams are seen before its network card has them: their UDP checksum is often not computed yet, and
short frames are not padded to Ethernet's 60 bytes. Those from elsewhere have both.
"""

from enum import Enum
from typing import Final

from transport.capture.records import Packet

_LOOKED_AT: Final = 64
_IP_AND_UDP_BYTES: Final = 28
_ETHERNET_BYTES: Final = 14
_LEAST_FRAME_BYTES: Final = 60


class Place(Enum):
    """Where; the value is for people."""

    UNKNOWN = "where the capture was taken cannot be told from it, so wire and peer cannot be split"
    ONE_MACHINE = "both sides are on one machine: there is no wire between them"
    CLIENT = "taken on the client's machine: the wire is not in the answer times"
    CONTROLLER = "taken on the controller's machine: the wire is in the answer times, there and back"


class PlaceSeeker:
    """Looks at the first datagrams of either direction."""

    def __init__(self) -> None:
        self._looked = {True: 0, False: 0}
        self._own = {True: 0, False: 0}
        self._foreign = {True: 0, False: 0}
        self._loopback = False

    def look(self, packet: Packet, *, from_client: bool) -> None:
        """Look at a datagram."""
        if self._looked[from_client] >= _LOOKED_AT:
            return
        self._looked[from_client] += 1
        self._loopback |= packet.source[0].startswith("127.") or packet.source[0] == packet.destination[0]
        head = packet.payload_at - _IP_AND_UDP_BYTES
        frame = packet.frame
        if head < 0 or frame[head] != 0x45:
            return
        end = packet.payload_at + len(packet.payload)
        checksum = int.from_bytes(frame[packet.payload_at - 2 : packet.payload_at], "big")
        if checksum and not _checksum_fits(frame[head:end]):
            self._own[from_client] += 1
        elif head == _ETHERNET_BYTES and end < _LEAST_FRAME_BYTES and frame[:6] != bytes(6):
            if len(frame) >= _LEAST_FRAME_BYTES:
                self._foreign[from_client] += 1
            else:
                self._own[from_client] += 1

    @property
    def place(self) -> Place:
        """Where it was taken."""
        if self._loopback:
            return Place.ONE_MACHINE
        of_client, of_controller = self._own_share(from_client=True), self._own_share(from_client=False)
        if of_client and not of_controller:
            return Place.CLIENT
        if of_controller and not of_client:
            return Place.CONTROLLER
        return Place.UNKNOWN

    def _own_share(self, *, from_client: bool) -> bool:
        own = self._own[from_client]
        return 10 * own > 9 * max(self._looked[from_client] - self._foreign[from_client], 1) and own > 0


def _checksum_fits(packet: bytes) -> bool:
    """Whether the UDP checksum of an IPv4 packet without options is right."""
    udp = packet[20:]
    pseudo = packet[12:20] + bytes((0, 17)) + len(udp).to_bytes(2, "big") + udp
    pseudo += bytes(len(pseudo) % 2)
    total = sum(int.from_bytes(pseudo[at : at + 2], "big") for at in range(0, len(pseudo), 2))
    return total % 0xFFFF == 0
