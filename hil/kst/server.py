"""The server: one TCP client at a time, one after the other, each with a session of its own at the controller."""

import asyncio
import contextlib
import socket
from collections import Counter
from collections.abc import Callable
from typing import Final, NamedTuple

from hil.client.servo import HilError
from hil.clock import Clock
from hil.kst.arm import ServoArm
from hil.kst.connection import Connection, prepare
from hil.kst.jobs import Ended
from hil.kst.log import how_many, is_told
from hil.kst.original import OriginalSession
from hil.kst.robot import Robot
from hil.kst.session import KstSession
from hil.values.kst import KstSettings
from hil.values.link import Address
from transport.kst import NAK, Problem

ACCEPT_S: Final = 60.0
"""How long a published server waits for its client."""
PAUSE_S: Final = 0.05
"""How long nobody is let in after somebody could not be."""
TELL_S: Final = 0.05
"""How often what a session says is taken."""


class _Caller(NamedTuple):
    """A connection that was accepted."""

    sock: socket.socket
    peer: Address


class _Visit(NamedTuple):
    """A client that is served."""

    peer: Address
    session: KstSession
    connection: Connection
    arm: ServoArm


class KstServer:
    """Serves the clients of ``listener``, which does not block and is the server's from now on, until :meth:`stop`.

    ``robot`` makes a session at the controller for each; ``tell`` is the log.
    """

    def __init__(
        self,
        listener: socket.socket,
        *,
        settings: KstSettings,
        make_robot: Callable[[Callable[[str], None]], Robot],
        clock: Clock,
        tell: Callable[[str], None],
    ) -> None:
        self.settings = settings
        self.sessions = 0
        self._listener = listener
        self._make_robot = make_robot
        self._clock = clock
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._stopped = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._visit: _Visit | None = None
        self._next: _Caller | None = None
        """Who came while the one before was let go."""
        self._counters: Counter[str] = Counter()
        self._refused: Counter[Problem] = Counter()
        self._outputs: dict[str, bool] = {}
        self._second_clients = 0
        self._tcp: dict[str, object] | None = None

    async def serve(self) -> None:
        """Serve until :meth:`stop`, or, strictly, until the one session is over."""
        self._loop.add_reader(self._listener, self._acceptable)
        timeout = None
        if self.settings.strict:
            timeout = self._loop.call_later(ACCEPT_S, self._nobody_came)
        try:
            await self._stopped.wait()
        finally:
            if timeout is not None:
                timeout.cancel()
            self._loop.remove_reader(self._listener)
            self._listener.close()
            if self._visit is not None:
                self._visit.connection.end("the controller ends")
            if self._next is not None:
                _close(self._next.sock)
            if self._task is not None:
                await asyncio.gather(self._task, return_exceptions=True)

    def stop(self) -> None:
        """Ask for the end."""
        self._stopped.set()

    def report(self) -> dict[str, object]:
        """Return what it did, for JSON."""
        visit = self._visit
        counters, refused, outputs = self._counters.copy(), self._refused.copy(), self._outputs
        if visit is not None:
            counters += visit.session.counters
            refused += visit.session.log.refused
            outputs = outputs | visit.session.outputs
        return {
            "strict": self.settings.strict,
            "nagle": self.settings.nagle,
            "client": None if visit is None else str(visit.peer),
            "phase": None if visit is None else visit.session.phase.value,
            "sessions": self.sessions,
            "second_clients": self._second_clients,
            "counters": dict(sorted(counters.items())),
            "refused": {problem.value: count for problem, count in sorted(refused.items())},
            "outputs": outputs,
            "tcp": self._tcp if visit is None else visit.connection.watch.report(),
        }

    def _nobody_came(self) -> None:
        if not self.sessions:
            self._tell(f"no client came within {ACCEPT_S:g} s: a published server ends then, and so does this one")
            self.stop()

    def _acceptable(self) -> None:
        try:
            sock, peer = self._listener.accept()
        except OSError:
            # Gone again before it was let in, or no descriptor is left: nothing the others should suffer from.
            self._loop.remove_reader(self._listener)
            self._loop.call_later(PAUSE_S, self._listen_again)
            return
        caller = _Caller(sock, Address(*peer))
        prepare(sock, nagle=self.settings.nagle, keep_alive=not self.settings.strict)
        if self._task is None:
            self._begin(caller)
        elif self._leaves and self._next is None:
            self._next = caller
        else:
            self._turn_away(caller)

    def _begin(self, caller: _Caller) -> None:
        if self.settings.strict:
            # It accepts once; whoever comes then waits in the backlog for ever.
            self._loop.remove_reader(self._listener)
        self.sessions += 1
        self._task = self._loop.create_task(self._serve_one(caller), name=f"KST client {caller.peer}")

    @property
    def _leaves(self) -> bool:
        """Whether the client that is served has gone, and only its arm has to come to rest."""
        return self._visit is not None and self._visit.connection.over.is_set()

    def _listen_again(self) -> None:
        if not self._stopped.is_set():
            self._loop.add_reader(self._listener, self._acceptable)

    def _turn_away(self, caller: _Caller) -> None:
        self._second_clients += 1
        served = "another" if self._visit is None else str(self._visit.peer)
        if is_told(self._second_clients):
            sentence = f"{caller.peer} was turned away: {served} is served, and KST serves one client at a time"
            self._tell(sentence + how_many(self._second_clients))
        with contextlib.suppress(OSError):
            caller.sock.send(NAK)
        _close(caller.sock)

    async def _serve_one(self, caller: _Caller) -> None:
        sock, peer = caller
        robot = self._make_robot(self._tell)
        try:
            await robot.connect()
            await self._visited(sock, peer, robot)
        except HilError as error:
            self._tell(f"{peer} cannot be served: {error}")
        except OSError as error:
            self._tell(f"{peer} cannot be served: {error.strerror or error}")
        except Exception as error:  # noqa: BLE001  # the next client is served all the same
            self._tell(f"the session of {peer} failed, which is a fault of the server: {error!r}")
        finally:
            try:
                await robot.close()
            except Exception as error:  # noqa: BLE001  # the next client is served all the same
                self._tell(f"the session of {peer} did not end in order: {error!r}")
            _close(sock)
            self._note(self._visit)
            self._visit = self._task = None
            if self.settings.strict:
                self._tell("a published server ends with its session, and so does this one (--kst-strict)")
                self.stop()
            following, self._next = self._next, None
            if following is not None and not self._stopped.is_set():
                self._begin(following)

    async def _visited(self, sock: socket.socket, peer: Address, robot: Robot) -> None:
        visit = self._new_visit(sock, peer, robot)
        session, connection, arm = visit.session, visit.connection, visit.arm
        self._visit = visit
        self._tell(f"{peer} is served")
        try:
            await self._watch(visit, robot)
        finally:
            connection.end("the controller ends")
            _close(sock)
            moving = session.busy
            if moving and self.settings.strict and session.over:
                await arm.finish()
            else:
                await arm.abort()
            self._take_words(visit)
            braked = "; the arm brakes" if moving and not self.settings.strict else ""
            self._tell(f"{peer} is served no more: {connection.why}{braked}; {_in_short(session)}")

    def _note(self, visit: _Visit | None) -> None:
        """Keep what is to be reported of a visit that is over."""
        if visit is not None:
            self._tcp = visit.connection.watch.report()
            self._counters += visit.session.counters
            self._refused += visit.session.log.refused
            self._outputs |= visit.session.outputs

    def _new_visit(self, sock: socket.socket, peer: Address, robot: Robot) -> _Visit:
        settings, clock = self.settings, self._clock

        def ended(ended: Ended) -> None:
            try:
                visit.session.ended(ended, now_ns=clock.now_ns())
                visit.connection.work()
            except Exception as error:  # noqa: BLE001  # nobody else looks at the arm's task, and a client waits
                self._tell(f"the session of {peer} failed, which is a fault of the server: {error!r}")
                visit.connection.end("the server failed")

        arm = ServoArm(robot, settings, ended=ended, tell=self._tell, now_ns=clock.now_ns)
        kind = OriginalSession if settings.strict else KstSession
        session = kind(settings, arm, robot.state)
        arm.registers = session.registers
        connection = Connection(sock, session, now_ns=clock.now_ns, answers_eof=not settings.strict)
        visit = _Visit(peer, session, connection, arm)
        return visit

    async def _watch(self, visit: _Visit, robot: Robot) -> None:
        """Take what the session says, and end it when the controller's is over."""
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(TELL_S):
                    await visit.connection.over.wait()
            self._take_words(visit)
            if not robot.is_there:
                visit.connection.end("the controller ended the session of this server")
            if visit.connection.over.is_set():
                return

    def _take_words(self, visit: _Visit) -> None:
        while visit.session.log.told:
            self._tell(visit.session.log.told.popleft())
        for finding in visit.connection.watch.news():
            self._tell(f"tcp: {finding.sentence}")


def _in_short(session: KstSession) -> str:
    counters = session.counters
    refused = sum(session.log.refused.values())
    return f"{counters['lines']} lines, {counters['set_points']} set-points, {refused} refused"


def _close(sock: socket.socket) -> None:
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_WR)
        # What is not read at the close would make the kernel send a reset, which overtakes the last reply.
        sock.recv(1 << 16)
    sock.close()
