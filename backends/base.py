"""Base of the robot sides that live in this process: owns the checks and the life cycle, a backend fills in hooks."""

import math
from abc import ABC, abstractmethod
from typing import Final

from hil.values.arm import AT_WORK, ArmState, Capabilities, Contact, JointCommand, Push, RobotSideCondition
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import DriveState
from hil.values.robot import JOINT_COUNT, Seven

BRAKE_RELEASE_NS: Final = 300_000_000
"""From switching on to ACTIVE. Ours: no public figure; brakes of such drives take some tenths of a second to open."""

_NO_TORQUE: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_OFF = (DriveState.OFF,) * JOINT_COUNT
_TRANSITIONING = (DriveState.TRANSITIONING,) * JOINT_COUNT
_ACTIVE = (DriveState.ACTIVE,) * JOINT_COUNT


class InProcessBackend(ABC):
    """``open`` and ``close`` are idempotent; ``open`` never moves the arm; reading a closed backend is an error.

    The seven drives are switched together. Brakes grip at once, and are released in ``BRAKE_RELEASE_NS`` of stepped
    time.
    """

    def __init__(self) -> None:
        self._period_ns: int | None = None
        self._drive_states = _ACTIVE
        self._release_in_steps = 0
        self._sample = 0
        self._measured: ArmState | None = None

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """What this robot side can do."""

    def open(self, *, period_ns: int) -> None:
        """Get ready to be stepped every ``period_ns``, drives on; raise :class:`ConfigurationError` if it cannot."""
        if self._period_ns is not None:
            return
        shortest_ns, longest_ns = self.capabilities.shortest_period_ns, self.capabilities.longest_period_ns
        if period_ns > longest_ns:
            raise ConfigurationError(
                f"a control cycle of {period_ns / 1e6:g} ms is longer than this backend's {longest_ns / 1e6:g} ms"
            )
        if period_ns < shortest_ns or period_ns % shortest_ns:
            raise ConfigurationError(
                f"a control cycle of {period_ns / 1e6:g} ms is no multiple of this backend's {shortest_ns / 1e6:g} ms"
            )
        if self._drive_states is not _ACTIVE:
            self._release_brakes()
            self._drive_states = _ACTIVE
        self._open(period_ns)
        self._sample += 1
        self._measured = None
        self._period_ns = period_ns

    def read(self) -> ArmState:
        """Return the newest measured state; the same one until the next step, but for what the drives do."""
        measured = self._measured
        if measured is None or self._period_ns is None:
            self._require_open("read")
            try:
                measured = self._measured = self._read()
            except Exception as error:
                raise self._failure("read", error) from error
        return measured

    def write(self, command: JointCommand) -> None:
        """Take the command of this cycle; raise :class:`BackendError` for what is not told in the capabilities."""
        if self._period_ns is None:
            self._require_open("write")
        if command.torque_nm is not None and not self.capabilities.takes_torque:
            raise BackendError(f"{type(self).__name__} takes no torque commands")
        if command.overlay is not None and not self.capabilities.passes_overlays:
            raise BackendError(f"{type(self).__name__} passes no overlays on")
        try:
            self._write(command)
        except Exception as error:
            raise self._failure("write", error) from error

    def step(self) -> None:
        """Let one period pass."""
        if self._period_ns is None:
            self._require_open("step")
        try:
            self._step()
            if self._drive_states is _TRANSITIONING:
                self._release_in_steps -= 1
                if self._release_in_steps == 0:
                    self._release_brakes()
                    self._drive_states = _ACTIVE
        except Exception as error:
            raise self._failure("step", error) from error
        self._sample += 1
        self._measured = None

    def switch_drives(self, *, on: bool) -> None:
        """Release the brakes and let the drives hold the arm, or drop them and let the brakes grip; idempotent."""
        period_ns = self._require_open("switch the drives of")
        if on == (self._drive_states is not _OFF):
            return
        # What was measured before the switch stays what was measured; only the drives are told anew.
        measured = self.read()
        if on:
            self._drive_states = _TRANSITIONING
            self._release_in_steps = math.ceil(BRAKE_RELEASE_NS / period_ns)
        else:
            try:
                self._apply_brakes()
            except Exception as error:
                raise self._failure("switch_drives", error) from error
            self._drive_states = _OFF
        self._measured = measured._replace(drive_states=self._drive_states, commanded_torque_nm=_NO_TORQUE)

    def condition(self) -> RobotSideCondition:
        """Return that it always takes commands; a backend that can fail says so here."""
        return AT_WORK

    def resume(self) -> None:
        """Nothing was lost."""
        return

    def push(self, push: Push) -> None:
        """Push the arm from the next step on; raise :class:`BackendError` where nothing can."""
        period_ns = self._require_open("push")
        self._push(push, math.ceil(push.duration_s * 1e9 / period_ns))

    def contacts(self) -> tuple[Contact, ...]:
        """Return what touches the arm as of the last step, the strongest first; nothing, unless a backend feels it."""
        self._require_open("ask what touches")
        try:
            return self._contacts()
        except Exception as error:
            raise self._failure("contacts", error) from error

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

    def _require_open(self, what: str) -> int:
        """Return the period, which only an open robot side has."""
        if self._period_ns is None:
            raise BackendError(f"cannot {what} a {type(self).__name__} that is not open")
        return self._period_ns

    @abstractmethod
    def _open(self, period_ns: int, /) -> None: ...

    @abstractmethod
    def _read(self) -> ArmState: ...

    @abstractmethod
    def _write(self, command: JointCommand) -> None: ...

    @abstractmethod
    def _step(self) -> None: ...

    @abstractmethod
    def _apply_brakes(self) -> None:
        """From the next step on the motors give nothing and the brakes hold; also while they are being released."""

    @abstractmethod
    def _release_brakes(self) -> None:
        """From the next step on the drives hold the newest command, or the one that comes before that step."""

    def _push(self, _push_told: Push, _steps: int, /) -> None:
        """Refuse, unless a backend can be pushed."""
        raise BackendError(f"{type(self).__name__} cannot be pushed")

    def _contacts(self) -> tuple[Contact, ...]:
        """Feel nothing, unless a backend does."""
        return ()

    def _close(self) -> None:
        """Nothing to release unless a backend says so."""
        return
