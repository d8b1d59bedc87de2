"""The comment of a capture's section, e.g. the run's configuration as JSON."""

from pathlib import Path

from transport.capture.errors import CaptureError

MAX_COMMENT_BYTES = 65_535
"""A pcapng option counts its bytes in 16 bits."""


def encode_comment(path: Path | str, comment: str) -> bytes:
    """``comment`` as the file holds it; raises ``CaptureError``, naming ``path``, where it does not fit."""
    try:
        data = comment.encode()
    except UnicodeEncodeError as error:
        raise CaptureError(path, f"the comment is not text: {error.reason} at character {error.start}") from error
    if len(data) > MAX_COMMENT_BYTES:
        raise CaptureError(path, f"the comment has {len(data)} bytes; a section holds at most {MAX_COMMENT_BYTES}")
    return data
