"""IPv4 address and port, and their six bytes in network order."""

import socket
import struct

from hil.values.errors import UsageError

Endpoint = tuple[str, int]
"""IPv4 address in dotted decimals, port 0 to 65535."""

ENDPOINT_BYTES = 6
MAX_PAYLOAD_BYTES = 65_535 - 20 - 8
"""The largest IPv4 packet less the IPv4 and the UDP header."""

_BYTES = struct.Struct("!4sH")


def pack_endpoint(endpoint: Endpoint) -> bytes:
    """The six bytes of ``endpoint``; raises ``UsageError`` for a host name, IPv6 or an impossible port."""
    host, port = endpoint
    try:
        return _BYTES.pack(socket.inet_pton(socket.AF_INET, host), port)
    except (OSError, struct.error) as error:
        raise UsageError(
            f"{endpoint!r} cannot be captured; valid: an IPv4 address in dotted decimals and a port of 0 to 65535"
        ) from error


def unpack_endpoint(data: bytes) -> Endpoint:
    """The endpoint of six bytes."""
    host, port = _BYTES.unpack(data)
    return socket.inet_ntop(socket.AF_INET, host), port
