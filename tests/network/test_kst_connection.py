"""One KST connection over a socket pair, in this process."""

import asyncio
import socket
from contextlib import closing
from itertools import count, pairwise

from hil.clock import let_others_run
from hil.kst.connection import READ_MOST_BYTES, Connection
from tests.support.kst_session import MS, Bench


def test_a_flood_leaves_the_event_loop_to_the_others_in_between() -> None:
    async def main() -> tuple[list[int], list[int]]:
        session, clock, passes = Bench().session, count(step=40 * MS), 0
        sizes: list[int] = []
        passed: list[int] = []
        take = session.receive

        def receive(data: bytes, *, now_ns: int) -> None:
            sizes.append(len(data))
            passed.append(passes)
            take(data, now_ns=now_ns)

        session.receive = receive  # type: ignore[method-assign]
        ours, theirs = socket.socketpair()
        with closing(ours), closing(theirs):
            ours.setblocking(False)
            theirs.sendall(b"jf_\n" * READ_MOST_BYTES)
            connection = Connection(ours, session, now_ns=lambda: next(clock))
            while sum(sizes) < 4 * READ_MOST_BYTES:
                passes += 1
                await let_others_run(1)
            connection.end("that is all")
        return sizes, passed

    sizes, passed = asyncio.run(main())
    assert max(sizes) == READ_MOST_BYTES
    assert all(later - earlier > 5 for earlier, later in pairwise(passed))
