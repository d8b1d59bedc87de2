"""What the recorder's parent sends is what its child understands."""

from hypothesis import given
from hypothesis import strategies as st

from transport.capture.batches import (
    DATAGRAM,
    FULL_BATCH_BYTES,
    MAX_MESSAGE_BYTES,
    NOTE,
    NOTE_HEAD,
    RECORD_HEAD,
    BatchRecord,
    Opening,
    Ring,
    pack_opening,
    unpack_batch,
    unpack_opening,
)
from transport.capture.comment import MAX_COMMENT_BYTES
from transport.capture.endpoints import MAX_PAYLOAD_BYTES, pack_endpoint
from transport.capture.records import CapturedDatagram

STOCK_SEND_BUFFER_BYTES = 212_992

endpoints = st.tuples(st.ip_addresses(v=4).map(str), st.integers(0, 65_535))
datagrams = st.builds(CapturedDatagram, st.integers(0, (1 << 64) - 1), endpoints, endpoints, st.binary(max_size=200))


@given(st.lists(datagrams | st.binary(max_size=40)))
def test_a_batch_gives_its_records_back(records: list[BatchRecord]) -> None:
    assert list(unpack_batch(b"".join(map(packed, records)))) == records


def packed(record: BatchRecord) -> bytes:
    if isinstance(record, bytes):
        return NOTE_HEAD.pack(NOTE, len(record)) + record
    route = pack_endpoint(record.source) + pack_endpoint(record.destination)
    return RECORD_HEAD.pack(DATAGRAM, len(record.payload), record.at_unix_ns, route) + record.payload


@given(st.binary(), st.none() | st.builds(Ring, st.integers(1, 1 << 31), st.integers(1, 1 << 63)))
def test_the_opening_carries_any_comment_and_is_never_empty(comment: bytes, ring: Ring | None) -> None:
    message = pack_opening(Opening(comment, ring))
    assert message
    assert unpack_opening(message) == Opening(comment, ring)


def test_every_message_fits_the_receiver_and_the_send_buffer_of_a_stock_system() -> None:
    longest_batch = FULL_BATCH_BYTES + RECORD_HEAD.size + MAX_PAYLOAD_BYTES
    longest = max(longest_batch, len(pack_opening(Opening(b"x" * MAX_COMMENT_BYTES))))
    assert longest <= MAX_MESSAGE_BYTES < STOCK_SEND_BUFFER_BYTES
