"""A robot side on the bench: the backend, and everything that lives behind it, one period at a time."""

from abc import ABC, abstractmethod
from typing import Final

from hil.values.arm import ArmState, Backend, JointCommand
from hil.values.errors import BackendError
from hil.values.robot import JOINT_COUNT, Seven

STILL: Final[Seven] = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
MOST_CYCLES_TO_READY: Final = 20_000


class Rig(ABC):
    """One robot side that is not open yet; a suite or a comparison opens it, lets time pass, and closes it."""

    has_peer = False
    """Whether there is somebody behind the backend who can be lost."""

    @property
    @abstractmethod
    def backend(self) -> Backend:
        """The backend itself."""

    def open(self, *, period_ns: int) -> None:
        """Open the backend, and have a measured state; raise what the backend raises."""
        self.backend.open(period_ns=period_ns)

    def cycle(self, command: JointCommand | None = None) -> ArmState:
        """Write a command, let one period pass on both sides, and return the newest measured state."""
        if command is not None:
            self.backend.write(command)
        self.backend.step()
        return self.backend.read()

    def get_ready(self) -> ArmState:
        """Let time pass until the robot side takes commands; raise :class:`BackendError` with the reason if never."""
        state = self.backend.read()
        for _ in range(MOST_CYCLES_TO_READY):
            condition = self.backend.condition()
            if condition.takes_commands:
                return state
            state = self.cycle(JointCommand(condition.held_position_rad or state.position_rad, STILL))
        raise BackendError(f"it never takes commands: {self.backend.condition().reason}")

    @abstractmethod
    def true_position_rad(self) -> Seven:
        """Where the arm really is, whatever the backend says."""

    def lose_peer(self) -> None:
        """Who is behind the backend falls silent."""
        raise NotImplementedError(f"{type(self).__name__} has no peer that could be lost")

    def restore_peer(self) -> None:
        """Who is behind the backend is there again."""
        raise NotImplementedError(f"{type(self).__name__} has no peer that could come back")

    def close(self) -> None:
        """Close the backend and what is behind it."""
        self.backend.close()


class InProcessRig(Rig):
    """A backend with nothing behind it."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    @property
    def backend(self) -> Backend:
        """The backend itself."""
        return self._backend

    def true_position_rad(self) -> Seven:
        """A simulated arm is where it says, without noise."""
        return self._backend.read().position_rad
