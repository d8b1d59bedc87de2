"""The error of the captures."""

from pathlib import Path

from hil.values.errors import HilError


class CaptureError(HilError):
    """A capture file that cannot be created, written or understood.

    ``offset`` is the byte in the file where the trouble begins, ``packet`` the number of the packet (from 1, as
    Wireshark counts); both are ``None`` where they have no meaning.
    """

    def __init__(self, path: Path | str, reason: str, *, offset: int | None = None, packet: int | None = None) -> None:
        self.path, self.reason, self.offset, self.packet = path, reason, offset, packet
        places = []
        if packet is not None:
            places.append(f"packet {packet}")
        if offset is not None:
            places.append(f"byte {offset}")
        place = f" at {', '.join(places)}" if places else ""
        super().__init__(f"capture {path}{place}: {reason}")


def cannot_create(path: Path, error: OSError) -> CaptureError:
    """The sentence for an ``error`` the system raised when ``path`` was to be created."""
    if isinstance(error, FileNotFoundError):
        return CaptureError(path, f"cannot be created: there is no folder {path.parent}")
    return CaptureError(path, f"cannot be created: {error.strerror or error}")
