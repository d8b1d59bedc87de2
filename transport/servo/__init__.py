"""The servo link's codec: bytes to values and back, and the key that both ends may share."""

from transport.servo.codec import ServoCodec
from transport.servo.tag import load_key, write_key

__all__ = ["ServoCodec", "load_key", "write_key"]
