"""A recording of a real robot, through the comparison."""

from pathlib import Path

from hil.replay.guess import Flow
from hil.replay.replay import ProgressTold, Wish, flows_of, packets_of
from hil.values.errors import MalformedDatagram, UsageError
from hil.values.fri import Release
from hil.values.link import Address
from tools.shadow.comparison import ShadowComparison
from transport.fri import FriCodec

_TELL_EVERY = 200


def compare_recording(
    file: Path, *, release: Release | None, robot: str, progress: ProgressTold | None = None
) -> tuple[ShadowComparison, Flow, list[str]]:
    """Return the comparison of the first controller in ``file``, which it is, and what is to be known of it.

    Raises ``CaptureError`` where nothing can be read and :class:`UsageError` where nothing there is FRI.
    """
    flows = flows_of(file, Wish(release))
    if not flows:
        raise UsageError(f"{file}: no datagram in it is a monitoring message of FRI")
    (route, flow), *others = flows.items()
    notes = list(flow.notes)
    if others:
        notes.append(f"{len(others)} more controllers are in the recording: only {flow.controller} is compared")
    codec, comparison = FriCodec(flow.release), ShadowComparison(release=flow.release, robot=robot)
    whole_bytes = file.stat().st_size
    for packet in packets_of(file):
        if (Address(*packet.source), Address(*packet.destination)) != route:
            continue
        try:
            message = codec.decode_monitoring(packet.payload)
        except MalformedDatagram:
            comparison.counts["malformed"] += 1
            continue
        comparison.take(message, packet.at_unix_ns)
        if progress is not None and comparison.compared % _TELL_EVERY == 0:
            progress(packet.offset, whole_bytes, f"{comparison.compared} compared")
    comparison.close()
    return comparison, flow, notes
