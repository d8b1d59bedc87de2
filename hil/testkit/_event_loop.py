"""An event loop in virtual time: what asyncio would wait for in the kernel lets time pass instead."""

import asyncio
import selectors
from collections.abc import Coroutine, Mapping
from typing import Any, Final, TypeVar

from hil.testkit._sockets import FIRST_FILE_NUMBER, whole_ns
from hil.testkit._world import World

PASS_NS: Final = 1_000
"""What a pass of the loop costs, so that tasks that only yield to each other come to an end."""

_T = TypeVar("_T")


def run_async(world: World, main: Coroutine[Any, Any, _T]) -> _T:
    """Run ``main`` to its end, as ``asyncio.run`` does, in the time of ``world``."""
    world.in_virtual_loop = True
    try:
        with asyncio.Runner(loop_factory=lambda: VirtualEventLoop(world)) as runner:
            return runner.run(main)
    finally:
        world.in_virtual_loop = False


class VirtualEventLoop(asyncio.SelectorEventLoop):
    """Its time is that of ``world``. Threads that wake it do so at a time nobody can foresee."""

    def __init__(self, world: World) -> None:
        self._world = world
        super().__init__(_VirtualSelector(world))

    def time(self) -> float:
        """Return virtual time in seconds."""
        return self._world.now_ns * 1e-9


class _VirtualSelector(selectors.BaseSelector):
    """Watches virtual sockets, by the numbers the loop has of them, and real files as long as they are ready."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._real = selectors.DefaultSelector()
        self._keys: dict[int, selectors.SelectorKey] = {}

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        number = _number(fileobj)
        if number < FIRST_FILE_NUMBER:
            return self._real.register(fileobj, events, data)
        if number in self._keys:
            raise KeyError(f"file {number} is registered already")
        self._keys[number] = key = selectors.SelectorKey(fileobj, number, events, data)
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        number = _number(fileobj)
        return self._real.unregister(fileobj) if number < FIRST_FILE_NUMBER else self._keys.pop(number)

    def modify(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        number = _number(fileobj)
        if number < FIRST_FILE_NUMBER:
            return self._real.modify(fileobj, events, data)
        self._keys[number] = key = selectors.SelectorKey(fileobj, number, events, data)
        return key

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        until_ns = None if timeout is None else self._world.now_ns + max(PASS_NS, whole_ns(timeout))
        self._world.wait(self._any_ready, until_ns=until_ns)
        return self._real.select(0) + [
            (key, selectors.EVENT_READ) for key in self._keys.values() if self._is_ready(key)
        ]

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return {**self._real.get_map(), **self._keys}

    def get_key(self, fileobj: Any) -> selectors.SelectorKey:
        number = _number(fileobj)
        return self._real.get_key(fileobj) if number < FIRST_FILE_NUMBER else self._keys[number]

    def close(self) -> None:
        self._real.close()
        self._keys.clear()

    def _any_ready(self) -> bool:
        return any(map(self._is_ready, self._keys.values())) or bool(self._real.select(0))

    def _is_ready(self, key: selectors.SelectorKey) -> bool:
        sock = self._world.socket_of(key.fd)
        return sock is not None and sock.readable and bool(key.events & selectors.EVENT_READ)


def _number(fileobj: Any) -> int:
    return fileobj if isinstance(fileobj, int) else int(fileobj.fileno())
