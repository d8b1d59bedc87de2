"""FRI clients of many arms in one process: ``python -m tools.bench.answering HOST PORT...`` mirrors until it is ended.

Each answers every message at once with the interpolator's position: the least a client can do that commands its arm.
"""

import selectors
import socket
import sys
from contextlib import ExitStack

from hil.client.fri import ClientSession, FriHandler
from hil.values.fri import Release

_MOST_BYTES = 2048


def main() -> None:
    """Serve every port."""
    host, ports = sys.argv[1], [int(port) for port in sys.argv[2:]]
    with ExitStack() as stack:
        selector = stack.enter_context(selectors.DefaultSelector())
        for port in ports:
            client = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            client.bind((host, port))
            selector.register(client, selectors.EVENT_READ, ClientSession(Release.V1_15, FriHandler()))
        while True:
            for key, _ in selector.select():
                client = key.fileobj  # type: ignore[assignment]  # nothing else is registered
                datagram, controller = client.recvfrom(_MOST_BYTES)
                answer = key.data.receive(datagram)
                if answer is not None:
                    client.sendto(answer, controller)


if __name__ == "__main__":
    main()
