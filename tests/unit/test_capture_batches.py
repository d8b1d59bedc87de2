"""What the recorder's parent sends is what its child understands."""

from hypothesis import given
from hypothesis import strategies as st

from transport.capture.batches import (
    FULL_BATCH_BYTES,
    MAX_MESSAGE_BYTES,
    RECORD_HEAD,
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


@given(st.lists(datagrams))
def test_a_batch_gives_its_records_back(records: list[CapturedDatagram]) -> None:
    batch = b"".join(
        RECORD_HEAD.pack(one.at_unix_ns, pack_endpoint(one.source) + pack_endpoint(one.destination), len(one.payload))
        + one.payload
        for one in records
    )
    assert list(unpack_batch(batch)) == records


@given(st.text())
def test_the_opening_carries_any_comment_and_is_never_empty(comment: str) -> None:
    message = pack_opening(comment.encode())
    assert message
    assert unpack_opening(message) == comment


def test_every_message_fits_the_receiver_and_the_send_buffer_of_a_stock_system() -> None:
    longest_batch = FULL_BATCH_BYTES + RECORD_HEAD.size + MAX_PAYLOAD_BYTES
    longest = max(longest_batch, len(pack_opening(b"x" * MAX_COMMENT_BYTES)))
    assert longest <= MAX_MESSAGE_BYTES < STOCK_SEND_BUFFER_BYTES
