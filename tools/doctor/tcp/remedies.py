"""What helps against Nagle's algorithm meeting delayed acknowledgements, for each side and its system.

Measured on Linux 6.18, loopback, a message in two writes: 44 ms. TCP_NODELAY at the writer, TCP_QUICKACK after every
receive and ``quickack 1`` on the route end it; TCP_QUICKACK set once does not (Linux takes it back with the next
reply); ``net.ipv4.tcp_pingpong_thresh`` at 255 left 1 stall in 350 messages. ``net.ipv4.tcp_autocorking`` changes
nothing here, and mainline Linux has no sysctl for the length of the delay, so neither is among the remedies.
"""

from enum import StrEnum

REGISTRY_PATH = r"HKEY_LOCAL_MACHINE\SYSTEM\CurrentControlSet\Services\Tcpip\Parameters\Interfaces"
"""Has one folder for each network adapter (manual 11.1)."""
ACK_FREQUENCY_KEY = "TcpAckFrequency"
NO_DELAY_KEY = "TCPNoDelay"
KEY_TYPE = "REG_DWORD"
KEY_VALUE = 1


class System(StrEnum):
    """Operating system of a side."""

    LINUX = "Linux"
    WINDOWS = "Windows"
    OTHER = "unknown"

    @classmethod
    def named(cls, name: str) -> "System":
        """Return the system that Python's ``platform.system()`` calls ``name``."""
        return next((system for system in cls if system == name), cls.OTHER)


def nagle_remedies(
    *, sender: str, acknowledger: str, sender_system: System = System.OTHER, acknowledger_system: System = System.OTHER
) -> tuple[str, ...]:
    """Return what helps where ``sender`` writes a message in parts and ``acknowledger`` is slow to acknowledge.

    The most effective first. Where a system is not known, what helps on Linux and on Windows is both told.
    """
    return (
        *sender_remedies(sender, sender_system),
        *acknowledger_remedies(acknowledger, acknowledger_system),
    )


def sender_remedies(side: str, system: System = System.OTHER) -> tuple[str, ...]:
    """Return what the side that writes in parts can do."""
    remedies = (
        (
            f"{side}: set TCP_NODELAY on the connection (Python: "
            "sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1); Java: socket.setTcpNoDelay(true))"
        ),
        f"{side}: write each message with one call, its line end or body included",
    )
    if system is System.LINUX:
        return remedies
    where = f"{side}:" if system is System.WINDOWS else f"{side}, if it runs Windows and its program cannot be changed:"
    return (*remedies, f"{where} {_registry(NO_DELAY_KEY)}")


def acknowledger_remedies(side: str, system: System = System.OTHER) -> tuple[str, ...]:
    """Return what the side that acknowledges late can do."""
    linux = (
        (
            f"{side}{_if(system, System.LINUX)}: set TCP_QUICKACK after every receive, not once: Linux takes it back "
            "(Python: sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1))"
        ),
        (
            f"{side}{_if(system, System.LINUX)}, where its program cannot be changed: ip route change <the route to "
            "the other side as ip route shows it> quickack 1"
        ),
        (
            f"{side}{_if(system, System.LINUX)}, 6.7 or newer, for the whole machine: sysctl -w "
            "net.ipv4.tcp_pingpong_thresh=255 (it makes late acknowledgements rare, it does not end them)"
        ),
    )
    windows = (f"{side}{_if(system, System.WINDOWS)}: {_registry(ACK_FREQUENCY_KEY)}",)
    match system:
        case System.LINUX:
            return linux
        case System.WINDOWS:
            return windows
        case System.OTHER:
            return (*linux, *windows)


def cabinet_remedies(side: str = "the PC") -> tuple[str, ...]:
    """Return what can be done where the other side is a real Sunrise Cabinet, whose sockets are not ours to change."""
    return (
        *sender_remedies(side),
        *acknowledger_remedies(side),
        (
            "the Cabinet's own system stays as it is; a robot application of yours there can call "
            "socket.setTcpNoDelay(true) and write each reply with one call"
        ),
    )


def _if(known: System, needed: System) -> str:
    return "" if known is needed else f", if it runs {needed}"


def _registry(key: str) -> str:
    return (
        f"create {key} ({KEY_TYPE}, value {KEY_VALUE}; upper and lower case as written) in the registry under "
        f"{REGISTRY_PATH}\\{{the adapter that has the right IP address}}, then reboot (manual 11.1)"
    )
