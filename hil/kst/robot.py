"""The server's own session at the controller: a commander's, or an observer's while somebody else commands."""

from collections.abc import Callable

from hil.client.servo import AsyncServoClient, EndpointError, Role, SessionRefused, Snapshot

WATCHDOG_MS = 300
CONNECT_S = 1.0
"""Whoever commanded before may still brake."""
_NAME = "KST server"


class Robot:
    """``make_client`` makes a client of a role, not yet connected."""

    def __init__(self, make_client: Callable[[Role], AsyncServoClient], *, tell: Callable[[str], None]) -> None:
        self._make_client = make_client
        self._tell = tell
        self._client: AsyncServoClient | None = None

    @property
    def is_there(self) -> bool:
        """Whether the session runs."""
        return self._client is not None and self._client.session.running

    @property
    def client(self) -> AsyncServoClient:
        """The client of the session; raise :class:`EndpointError` where there is none."""
        if self._client is None:
            raise EndpointError("there is no session at the controller")
        return self._client

    def state(self) -> Snapshot:
        """Return the controller's latest state; raise :class:`HilError` where there is no session."""
        return self.client.read_state()

    async def connect(self) -> None:
        """Begin a session; raise :class:`HilError`."""
        try:
            self._client = await self._connected(Role.COMMANDER)
        except SessionRefused as refused:
            self._tell(f"the arm is commanded by somebody else, and only queries are served: {refused}")
            self._client = await self._connected(Role.OBSERVER)

    async def commander(self) -> AsyncServoClient:
        """Return the client that may move the arm; raise :class:`HilError` while somebody else has it."""
        client = self.client
        if client.role is not Role.COMMANDER:
            commander = await self._connected(Role.COMMANDER)
            self._client = commander
            await client.close()
            return commander
        return client

    async def close(self) -> None:
        """End the session; what it commanded brakes."""
        client, self._client = self._client, None
        if client is not None:
            await client.close()

    async def _connected(self, role: Role) -> AsyncServoClient:
        client = self._make_client(role)
        await client.connect()
        return client


def client_factory(controller: str, *, state_period_ms: int, key: bytes | None) -> Callable[[Role], AsyncServoClient]:
    """Return a maker of clients of the controller at ``HOST:PORT``."""

    def make(role: Role) -> AsyncServoClient:
        return AsyncServoClient(
            controller,
            name=_NAME,
            role=role,
            watchdog_ms=WATCHDOG_MS,
            state_period_ms=state_period_ms,
            key=key,
            connect_timeout_s=CONNECT_S,
        )

    return make
