"""A stranger who sends datagrams at a rate: ``python -m tests.soak.flood HOST PORT RATE SECONDS``."""

import json
import socket
import sys

from hil.clock import Pause, elapsed_ns

BATCH = 250
SIZES = (0, 8, 64, 200, 1400)


def main() -> None:
    """Flood, and print how many a second left this process, as JSON."""
    host, port, rate, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
    payloads = [bytes(number % 256 for number in range(size)) for size in SIZES]
    sent = refused = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((host, 0))
        stranger.connect((host, port))
        pause = Pause(1.0)
        began_ns = elapsed_ns()
        while (now_ns := elapsed_ns() - began_ns) < seconds * 1e9:
            payload = payloads[sent // BATCH % len(payloads)]
            for _ in range(BATCH):
                try:
                    stranger.send(payload)
                except OSError:
                    refused += 1
            sent += BATCH
            pause.until(round(sent / rate * 1e9))
    print(json.dumps({"sent": sent, "refused": refused, "per_s": sent / (now_ns * 1e-9)}))  # noqa: T201


if __name__ == "__main__":
    main()
