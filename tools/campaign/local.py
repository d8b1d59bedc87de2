"""Scenarios on the cores of this machine: worker processes, one scenario each at a time.

A worker that dies, or takes longer than the campaign's patience, costs its scenario that try, and nothing else.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection, wait
from typing import Final, NamedTuple

from hil.arithmetic import fix_arithmetic
from hil.clock import elapsed_ns
from hil.values.errors import BackendError
from tools.campaign.scenario import Row, Scenario, empty_row

_LOOK_S: Final = 1.0
_END_S: Final = 5.0
_STARTING_S: Final = 60.0
"""What a fresh worker may take to import what it needs."""
_DEATHS_WITHOUT_A_ROW: Final = 20
"""So many in a row, on all workers, and no worker can run here at all."""


class _Task(NamedTuple):
    scenario: Scenario
    attempt: int


class _Worker:
    """A process that plays what it is given."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, child = context.Pipe()
        self.process = context.Process(target=_work, args=(child,), daemon=True, name="campaign worker")
        self.process.start()
        child.close()
        self.task: _Task | None = None
        self.started = False
        self._patience_s = _STARTING_S
        self._due_ns = elapsed_ns() + round(_STARTING_S * 1e9)

    def give(self, task: _Task, patience_s: float) -> None:
        """Let it play ``task``; its time counts from when the worker has started."""
        self.task, self._patience_s = task, patience_s
        if self.started:
            self._due_ns = elapsed_ns() + round(patience_s * 1e9)
        # Where it died meanwhile, that is seen as any other death.
        with contextlib.suppress(OSError):
            self.connection.send(task.scenario)

    def take(self) -> Row | None:
        """Return what it sends, None for that it has started; raise EOFError or OSError where it died."""
        row: Row | None = self.connection.recv()
        if row is None:
            self.started = True
            self._due_ns = elapsed_ns() + round(self._patience_s * 1e9)
        return row

    def overdue(self) -> bool:
        """Whether the campaign's patience with it is over."""
        return self.task is not None and elapsed_ns() > self._due_ns

    def end(self) -> None:
        """End it, whatever it does."""
        self.connection.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join(_END_S)
        self.process.close()


def play_locally(scenarios: Iterable[Scenario], *, workers: int, patience_s: float, retries: int) -> Iterator[Row]:
    """Yield a row for each scenario, as they end; raise :class:`BackendError` where no worker lives long enough."""
    pool = _Pool(deque(_Task(scenario, 1) for scenario in scenarios), patience_s=patience_s, retries=retries)
    try:
        pool.start(workers)
        yield from pool.rows()
    finally:
        pool.end()


class _Pool:
    """Workers, and the scenarios that wait for them."""

    def __init__(self, waiting: deque[_Task], *, patience_s: float, retries: int) -> None:
        self._waiting = waiting
        self._patience_s = patience_s
        self._retries = retries
        self._staff: list[_Worker] = []
        self._deaths = 0
        """Since the last row."""

    def start(self, workers: int) -> None:
        """Start so many workers, or as many as there are scenarios."""
        for _ in range(min(workers, len(self._waiting))):
            self._staff.append(_Worker())

    def end(self) -> None:
        """End all of them, also where one cannot be ended."""
        with contextlib.ExitStack() as ending:
            for worker in self._staff:
                ending.callback(worker.end)

    def rows(self) -> Iterator[Row]:
        """Yield a row for each scenario."""
        while self._hand_out():
            answered = set(wait([worker.connection for worker in self._staff if worker.task], _LOOK_S))
            for place, worker in enumerate(self._staff):
                if worker.task is None:
                    continue
                if worker.connection in answered:
                    row = self._taken(place, worker, worker.task)
                elif worker.overdue():
                    why = f"took longer than {self._patience_s:g} s" if worker.started else "no worker started"
                    row = empty_row(worker.task.scenario, "hung", why, attempts=worker.task.attempt)
                    row["wall_s"] = self._patience_s
                    self._replace(place)
                else:
                    continue
                if row is not None:
                    yield row

    def _hand_out(self) -> bool:
        """Give every idle worker something to do; return whether anybody has."""
        for worker in self._staff:
            if worker.task is None and self._waiting:
                worker.give(self._waiting.popleft(), self._patience_s)
        return any(worker.task for worker in self._staff)

    def _taken(self, place: int, worker: _Worker, task: _Task) -> Row | None:
        """Return the row that a worker sends; where it died, that of its scenario, or None for another try."""
        try:
            row = worker.take()
        except (EOFError, OSError):
            worker.process.join(_END_S)
            why = f"its worker died{_how(worker.process.exitcode)}"
        else:
            if row is None:
                return None
            self._deaths = 0
            worker.task = None
            row["attempts"] = task.attempt
            return row
        self._replace(place)
        self._deaths += 1
        if self._deaths >= _DEATHS_WITHOUT_A_ROW * len(self._staff):
            raise BackendError(f"{self._deaths} workers died one after the other, the last with {task.scenario.name}")
        if task.attempt <= self._retries:
            self._waiting.appendleft(_Task(task.scenario, task.attempt + 1))
            return None
        return empty_row(task.scenario, "worker-died", why, attempts=task.attempt)

    def _replace(self, place: int) -> None:
        self._staff[place].end()
        self._staff[place] = _Worker()


def _how(code: int | None) -> str:
    if code is None:
        return ""
    if code < 0:
        with contextlib.suppress(ValueError):
            return f" of {signal.Signals(-code).name}"
    return f" with exit code {code}"


def _work(connection: Connection) -> None:
    """Be a worker, until the other end closes."""
    # Ctrl-C is the campaign's to handle; it ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    fix_arithmetic()
    from tools.campaign.play import play

    # A program's own output goes through the play; what others write below that (C libraries) is nobody's.
    sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: PTH123, SIM115  # for as long as the process lives
    with contextlib.suppress(EOFError, OSError):
        connection.send(None)
        while True:
            scenario: Scenario = connection.recv()
            try:
                row = play(scenario)
            except KeyboardInterrupt:
                # Nobody's key: the program raised it itself.
                row = empty_row(scenario, "failed", "KeyboardInterrupt")
            connection.send(row)
