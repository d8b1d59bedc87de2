"""Calls to CoppeliaSim through its ZeroMQ remote API, each one bounded in time.

The package's client waits for ever for an answer, and its end waits for what was not sent. So its socket is given up
with the first answer that does not come, and what was not sent is dropped.
"""

import sys
from types import ModuleType
from typing import Any, Final

from hil.clock import Deadline
from hil.values.errors import ConfigurationError, EndpointError

DEFAULT_PORT: Final = 23000
DEFAULT_ADDRESS: Final = f"127.0.0.1:{DEFAULT_PORT}"
ANSWER_S: Final = 3.0
"""The longest wait for the answer to a call; the simulator draws and simulates between calls."""
LOAD_S: Final = 60.0
"""The same for loading a scene, whose meshes take their time."""
_INSTALL: Final = "pip install 'fri-hil[coppelia]'"


class SimulatorLost(EndpointError):
    """Nobody answers; the connection is closed."""


class CallRefused(EndpointError):
    """The simulator answered that it cannot."""


class Link:
    """A connection with one simulator, by numbers of objects as the simulator hands them out."""

    def __init__(self, address: str = DEFAULT_ADDRESS, *, answer_s: float = ANSWER_S) -> None:
        """``address`` is ``HOST[:PORT]``. Raises :class:`ConfigurationError` for none, and without the package."""
        self.address = _checked(address)
        self.round_trips = 0
        """Requests sent so far, over all connections."""
        self.answer_s = answer_s
        """The longest wait for an answer."""
        self._deadline = Deadline(answer_s)
        self._package = _package()
        self._client: Any = None  # the package has no types
        self._sim: Any = None

    @property
    def connected(self) -> bool:
        """Whether calls go through, as far as is known."""
        return self._client is not None

    def connect(self) -> None:
        """Connect, and ask what the simulator can; does nothing while connected. Raises :class:`SimulatorLost`."""
        if self._client is not None:
            return
        host, _, port = self.address.rpartition(":")
        self._client = client = self._package.RemoteAPIClient(host, int(port))
        # It leaves a function of its own in the main program, and would live as long as that.
        vars(sys.modules["__main__"]).pop("require", None)
        client.socket.linger = 0
        client.socket.sndtimeo = int(self.answer_s * 1000)
        client._send = self._counted(client._send)  # the package has no other place to bound a wait
        client._recv = self._bounded(client)
        self._sim = self._answered("sim", lambda: client.require("sim"), self.answer_s)

    def close(self) -> None:
        """Close; idempotent."""
        client, self._client, self._sim = self._client, None, None
        if client is not None:
            client.socket.close(linger=0)
            client.context.term()

    def constant(self, *names: str) -> int:
        """Return a constant of ``sim``, by the first of its names that the simulator's release has."""
        self._require_connection()
        for name in names:
            value = getattr(self._sim, name, None)
            if isinstance(value, int | float):
                return int(value)
        raise CallRefused(f"CoppeliaSim at {self.address} has no constant sim.{names[0]}: its release is not known")

    def call(self, function: str, *arguments: object, answer_s: float | None = None) -> Any:
        """Call ``sim.function`` and return its answer: nothing, a value, or a tuple of several.

        Raises :class:`CallRefused` with the simulator's words, and :class:`SimulatorLost`, also for every call after
        that: what objects have which number is not known any more, until somebody connects and looks again.
        """
        self._require_connection()
        name = f"sim.{function}"
        return self._answered(name, lambda: self._client.call(name, list(arguments)), answer_s or self.answer_s)

    def _require_connection(self) -> None:
        if self._client is None:
            raise SimulatorLost(f"the connection with CoppeliaSim at {self.address} is lost; refresh to connect again")

    def _answered(self, name: str, call: Any, answer_s: float) -> Any:
        from zmq.error import ZMQError

        self._deadline = Deadline(answer_s)
        try:
            return call()
        except (ZMQError, TimeoutError):
            self.close()
            raise SimulatorLost(
                f"nobody answers at {self.address} within {answer_s:g} s: is CoppeliaSim running there, with its "
                f"ZMQ remote API server (menu Modules, Connectivity)?"
            ) from None
        except Exception as error:  # the package raises no narrower one
            if type(error) is Exception:  # what the package raises for an error that was answered
                raise CallRefused(f"CoppeliaSim at {self.address} refuses {name}: {_words(error)}") from None
            self.close()
            raise SimulatorLost(
                f"what answers at {self.address} is no remote API of CoppeliaSim ({type(error).__name__}: {error})"
            ) from error

    def _counted(self, send: Any) -> Any:
        def counted(request: dict[str, Any]) -> None:
            self.round_trips += 1
            send(request)

        return counted

    def _bounded(self, client: Any) -> Any:
        receive = client._recv

        def bounded() -> Any:
            # Also where the simulator says again and again that it is not ready yet.
            left_s = self._deadline.left_s() or 0.0
            if left_s <= 0.0 or not client.socket.poll(left_s * 1000):
                raise TimeoutError
            return receive()

        return bounded


def _package() -> ModuleType:
    try:
        import coppeliasim_zmqremoteapi_client
    except ImportError as error:
        raise ConfigurationError(
            f"CoppeliaSim needs the package coppeliasim-zmqremoteapi-client, which is not installed: {_INSTALL}"
        ) from error
    package: ModuleType = coppeliasim_zmqremoteapi_client
    return package


def _checked(address: str) -> str:
    host, colon, port = address.rpartition(":")
    if not colon:
        host, port = address, str(DEFAULT_PORT)
    if not host or not host.isprintable() or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ConfigurationError(f"{address!r} is no address of a simulator; valid: HOST[:PORT], port 1..65535")
    return f"{host}:{port}"


def _words(error: Exception) -> str:
    # The server writes line ends so that they survive the way; the first line says what is wrong.
    lines = str(error).replace("_=NL=_", "\n").replace("_=TB=_", " ").strip().splitlines()
    return lines[0].strip().rstrip(".") if lines else "it says nothing"
