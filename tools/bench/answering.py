"""FRI clients of many arms in one process: ``python -m tools.bench.answering PARENT HOST PORT...``.

It ends when PARENT, who started it, is gone: nobody else ends it where a benchmark was killed.

Each answers every message at once with the interpolator's position: the least a client can do that commands its arm.
"""

import os
import selectors
import socket
import sys
from contextlib import ExitStack

from hil.client.fri import ClientSession, FriHandler
from hil.values.fri import Release

_MOST_BYTES = 2048


def main() -> None:
    """Serve every port."""
    parent, host, ports = int(sys.argv[1]), sys.argv[2], [int(port) for port in sys.argv[3:]]
    with ExitStack() as stack:
        selector = stack.enter_context(selectors.DefaultSelector())
        for port in ports:
            client = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            client.bind((host, port))
            selector.register(client, selectors.EVENT_READ, ClientSession(Release.V1_15, FriHandler()))
        while os.getppid() == parent:
            for key, _ in selector.select(1.0):
                client = key.fileobj  # type: ignore[assignment]  # nothing else is registered
                datagram, controller = client.recvfrom(_MOST_BYTES)
                answer = key.data.receive(datagram)
                if answer is not None:
                    client.sendto(answer, controller)


if __name__ == "__main__":
    main()
