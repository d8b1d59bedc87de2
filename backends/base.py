"""Base of the robot sides that live in this process: owns the checks and the life cycle, a backend fills in hooks."""

from abc import ABC, abstractmethod

from hil.values.arm import ArmState, Capabilities, JointCommand
from hil.values.errors import BackendError, ConfigurationError


class InProcessBackend(ABC):
    """``open`` and ``close`` are idempotent; ``open`` never moves the arm; reading a closed backend is an error."""

    def __init__(self) -> None:
        self._period_ns: int | None = None

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """What this robot side can do."""

    def open(self, *, period_ns: int) -> None:
        """Get ready to be stepped every ``period_ns``; raise :class:`ConfigurationError` if that is too short."""
        if self._period_ns is not None:
            return
        shortest_ns = self.capabilities.shortest_period_ns
        if period_ns < shortest_ns or period_ns % shortest_ns:
            raise ConfigurationError(
                f"a control cycle of {period_ns / 1e6:g} ms is no multiple of this backend's {shortest_ns / 1e6:g} ms"
            )
        self._open(period_ns)
        self._period_ns = period_ns

    def read(self) -> ArmState:
        """Return the newest measured state."""
        self._require_open("read")
        try:
            return self._read()
        except Exception as error:
            raise self._failure("read", error) from error

    def write(self, command: JointCommand) -> None:
        """Take the command of this cycle."""
        self._require_open("write")
        try:
            self._write(command)
        except Exception as error:
            raise self._failure("write", error) from error

    def step(self) -> None:
        """Let one period pass."""
        self._require_open("step")
        try:
            self._step()
        except Exception as error:
            raise self._failure("step", error) from error

    def close(self) -> None:
        """Release everything."""
        if self._period_ns is not None:
            self._period_ns = None
            self._close()

    def _failure(self, what: str, error: Exception) -> BackendError:
        """Whatever a robot side raises is a failure of the robot side, and must reach the shell as one."""
        if isinstance(error, BackendError):
            return error
        return BackendError(f"{type(self).__name__} failed in {what}: {type(error).__name__}: {error}")

    def _require_open(self, what: str) -> None:
        if self._period_ns is None:
            raise BackendError(f"cannot {what} a {type(self).__name__} that is not open")

    @abstractmethod
    def _open(self, period_ns: int, /) -> None: ...

    @abstractmethod
    def _read(self) -> ArmState: ...

    @abstractmethod
    def _write(self, command: JointCommand) -> None: ...

    @abstractmethod
    def _step(self) -> None: ...

    def _close(self) -> None:
        """Nothing to release unless a backend says so."""
        return
