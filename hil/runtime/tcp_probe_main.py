"""The responder's process: ``python -m hil.runtime.tcp_probe_main LISTENER_FD BEHAVIOUR``.

It serves until its standard input ends, by order or by the controller's death, and writes one line of JSON then: what
it did. It is started with the signals of a terminal blocked, so a Ctrl-C that ends the run leaves it time for that.
"""

import json
import os
import socket
import sys

from hil.clock import MonotonicClock
from hil.runtime.tcp_probe_server import ProbeServer
from hil.values.tcp_probe import Behaviour

_NICENESS = 5


def main() -> None:
    """Serve, and report."""
    descriptor, behaviour = int(sys.argv[1]), Behaviour(sys.argv[2])
    os.nice(_NICENESS)
    listener = socket.socket(fileno=descriptor)
    listener.setblocking(False)
    server = ProbeServer(listener, behaviour, clock=MonotonicClock())
    server.serve(sys.stdin.fileno())
    sys.stdout.write(json.dumps(server.report()) + "\n")


if __name__ == "__main__":
    main()
