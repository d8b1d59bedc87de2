"""FRI codecs for six releases: bytes to values and back."""

from transport.fri.codec import FriCodec

__all__ = ["FriCodec"]
