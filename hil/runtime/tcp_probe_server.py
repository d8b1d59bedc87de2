"""The TCP responder that ``hil doctor tcp`` measures against: a few connections in one loop, all of it bounded."""

import contextlib
import platform
import selectors
import socket
from collections import Counter

from hil.clock import Clock
from hil.values.tcp_probe import Behaviour
from hil.version import SOFTWARE
from transport.tcp import READ_MOST_BYTES, Allowance, Ending, Responder, Step, pack_refusal
from transport.tcp.sockets import CAN_QUICK_ACK, kernel_facts, set_no_delay, set_quick_ack

CONNECTIONS_MOST = 8
TURNS_PER_S = 1000
TURNS_AT_ONCE = 3000
"""Reads and connections of all peers together: enough for a doctor that measures 200 round trips of each kind."""
_PAUSE_NS = 50_000_000
"""How long nobody is let in after too many came."""


class ProbeServer:
    """Serves the connections of ``listener``, which does not block, until ``ends`` can be read. For one thread."""

    def __init__(self, listener: socket.socket, behaviour: Behaviour, *, clock: Clock) -> None:
        self._behaviour = behaviour
        self._clock = clock
        self._listener = listener
        self._selector = selectors.DefaultSelector()
        self._allowance = Allowance(per_second=TURNS_PER_S, most=TURNS_AT_ONCE)
        self._served: dict[socket.socket, Responder] = {}
        self._let_in_ns: int | None = None
        """When the listener is looked at again; None: it is."""
        self._ended: Counter[Ending] = Counter()
        self._accepted = self._turned_away = self._answered = 0

    def serve(self, ends: socket.socket | int) -> None:
        """Serve; at the end every connection is told, and the listener closed."""
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(ends, selectors.EVENT_READ)
        try:
            self._serve(ends)
        finally:
            for sock, responder in list(self._served.items()):
                responder.refuse(Ending.STOPPED, "the controller ends")
                self._go_on(sock, responder)
            self._selector.close()
            self._listener.close()

    def report(self) -> dict[str, object]:
        """Return what it did, for JSON."""
        return {
            "accepted": self._accepted,
            "turned_away": self._turned_away,
            "answered": self._answered,
            "ended": {ending.value: self._ended[ending] for ending in Ending},
        }

    def _serve(self, ends: socket.socket | int) -> None:
        while True:
            for key, _ in self._selector.select(self._wait_s()):
                if key.fileobj is ends:
                    return
                if key.fileobj is self._listener:
                    self._accept()
                elif isinstance(key.fileobj, socket.socket):
                    self._read(key.fileobj)
            now_ns = self._clock.now_ns()
            for sock, responder in list(self._served.items()):
                if now_ns >= responder.due_ns:
                    self._go_on(sock, responder)
            if self._let_in_ns is not None and now_ns >= self._let_in_ns:
                self._let_in_ns = None
                self._selector.register(self._listener, selectors.EVENT_READ)

    def _wait_s(self) -> float | None:
        dues_ns = [responder.due_ns for responder in self._served.values()]
        if self._let_in_ns is not None:
            dues_ns.append(self._let_in_ns)
        return max(0.0, (min(dues_ns) - self._clock.now_ns()) * 1e-9) if dues_ns else None

    def _accept(self) -> None:
        now_ns = self._clock.now_ns()
        if not self._allowance.take(now_ns):
            self._selector.unregister(self._listener)
            self._let_in_ns = now_ns + _PAUSE_NS
            return
        try:
            sock, _ = self._listener.accept()
        except OSError:
            # Gone again before it was let in, or no descriptor is left: nothing the others should suffer from.
            self._selector.unregister(self._listener)
            self._let_in_ns = now_ns + _PAUSE_NS
            return
        sock.setblocking(False)
        if len(self._served) >= CONNECTIONS_MOST:
            self._turned_away += 1
            _write(sock, Step(pack_refusal(f"{CONNECTIONS_MOST} connections are served already; come back later")))
            _close(sock)
            return
        self._accepted += 1
        responder = Responder(self._behaviour, now_ns=now_ns, can_quick_ack=CAN_QUICK_ACK)
        if not _write(sock, responder.opening(system=platform.system(), software=SOFTWARE)):
            self._ended[Ending.CLOSED] += 1
            _close(sock)
            return
        self._served[sock] = responder
        self._selector.register(sock, selectors.EVENT_READ)

    def _read(self, sock: socket.socket) -> None:
        responder = self._served[sock]
        if not responder.reads:
            return
        try:
            data = sock.recv(READ_MOST_BYTES)
            now_ns = self._clock.now_ns()
            if data:
                set_quick_ack(sock, responder.quick_ack)
        except BlockingIOError:
            return
        except OSError:
            data, now_ns = b"", self._clock.now_ns()
        if data and not self._allowance.take(now_ns):
            responder.refuse(Ending.FAST, f"more than {TURNS_PER_S} messages a second, {TURNS_AT_ONCE} at once, came")
        else:
            responder.receive(data, now_ns=now_ns)
        self._go_on(sock, responder)

    def _go_on(self, sock: socket.socket, responder: Responder) -> None:
        """Do what there is to be done now, and close what has ended."""
        before = responder.answered
        facts = kernel_facts(sock) if not responder.reads else None
        retransmissions = 0 if facts is None else facts.retransmissions
        for step in responder.steps(now_ns=self._clock.now_ns(), retransmissions=retransmissions):
            if not _write(sock, step) and responder.ending is None:
                responder.ending = Ending.NOT_READ
        self._answered += responder.answered - before
        if responder.ending is not None:
            self._ended[responder.ending] += 1
            del self._served[sock]
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(sock)
            _close(sock)
        else:
            # While a reply is held, what came meanwhile must not wake the thread again and again.
            wanted = responder.reads
            watched = sock in self._selector.get_map()
            if wanted and not watched:
                self._selector.register(sock, selectors.EVENT_READ)
            elif watched and not wanted:
                self._selector.unregister(sock)


def _write(sock: socket.socket, step: Step) -> bool:
    """Do one step; return whether all of it went out. A peer that does not read is not waited for."""
    try:
        if step.no_delay is not None:
            set_no_delay(sock, step.no_delay)
        return sock.send(step.write) == len(step.write)
    except OSError:
        return False


def _close(sock: socket.socket) -> None:
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_WR)
        # What is not read at the close would make the kernel send a reset, which overtakes the last sentence.
        sock.recv(1 << 16)
    sock.close()
