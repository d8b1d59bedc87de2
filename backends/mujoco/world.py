"""One MuJoCo world that several arms share, stepped once a cycle for all of them.

Each arm is driven by a controller of its own, whose cycles have a phase of their own. The world goes on when every open
arm has stepped, or when one is a whole cycle ahead: the others missed theirs, and hold what they were told last. An arm
that catches up steps into cycles that are over, and moves no time. So nobody stops the world, nobody makes it run, and
the same calls in the same order give the same bytes.
"""

from typing import TYPE_CHECKING, Final, Protocol

import mujoco

from backends.mujoco.backend import STEP_NS
from backends.mujoco.options import MujocoOptions
from backends.mujoco.scene import build, prefix_of
from backends.robots import load_description
from hil.values.backend import BackendRequest
from hil.values.errors import BackendError, ConfigurationError
from hil.values.robot import JOINT_NAMES

if TYPE_CHECKING:
    from hil.values.surroundings import SceneArm


MOST_CYCLES_BEHIND: Final = 20
"""An arm that is further behind does not catch up; the shell runs no more missed cycles at once either."""


class Inhabitant(Protocol):
    """An arm in a world."""

    name: str

    def drive(self, share: float) -> None:
        """Give the motors what they give after ``share`` of the cycle; the pose is that of now."""

    def stepped(self) -> None:
        """A cycle is over."""


class World:
    """One model with its data. ``scene`` is the file it was made from."""

    def __init__(self, model: "mujoco.MjModel", *, arms: "tuple[SceneArm, ...]", scene: object) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        for arm in arms:
            # One that is not made yet stands where it will begin.
            start = load_description(arm.model).initial_position_rad
            for name, value in zip(JOINT_NAMES, start, strict=True):
                self.data.joint(prefix_of(arm.name) + name).qpos[0] = value
        self.scene = scene
        self.cycles = 0
        self._period_ns: int | None = None
        self._inhabitants: list[Inhabitant] = []
        self._stepped: dict[str, int] = {}
        """Cycles of each open arm, on the count of :attr:`cycles`."""
        self._failed = ""

    def enter(self, arm: Inhabitant, *, period_ns: int) -> None:
        """An arm is opened; raise :class:`ConfigurationError` for another cycle than the others have."""
        if self._inhabitants and period_ns != self._period_ns:
            raise ConfigurationError(
                f"{arm.name} has a control cycle of {period_ns / 1e6:g} ms, and the others in its MuJoCo world have "
                f"{(self._period_ns or 0) / 1e6:g} ms: set cycle_ms to the same, or name another world for it"
            )
        self._period_ns = period_ns
        self._inhabitants.append(arm)
        self._stepped[arm.name] = self.cycles

    def leave(self, arm: Inhabitant) -> None:
        """An arm is closed; it holds on with its motors as they are."""
        if arm in self._inhabitants:
            self._inhabitants.remove(arm)
            del self._stepped[arm.name]

    def step(self, arm: Inhabitant) -> None:
        """A cycle of ``arm`` is over; let the world go on as far as it should be by now."""
        if self._failed:
            raise BackendError(self._failed)
        stepped = self._stepped
        stepped[arm.name] += 1
        latest = max(stepped.values())
        for name, count in stepped.items():
            if latest - count > MOST_CYCLES_BEHIND:
                stepped[name] = latest
        while self.cycles < max(min(stepped.values()), latest - 1):
            self._advance()

    def _advance(self) -> None:
        steps = (self._period_ns or 0) // STEP_NS
        before = self.data.time
        for index in range(steps):
            mujoco.mj_step1(self.model, self.data)
            for arm in self._inhabitants:
                arm.drive(index / steps)
            mujoco.mj_step2(self.model, self.data)
        # MuJoCo answers a diverged state by starting over at time zero.
        if self.data.time < before:
            self._failed = f"MuJoCo diverged at simulation time {before:.3f} s"
            raise BackendError(self._failed)
        self.cycles += 1
        for arm in self._inhabitants:
            arm.stepped()


def world_of(request: BackendRequest, options: MujocoOptions) -> World:
    """Return the world an arm stands in: that of all robots with the same ``world``, named or not."""
    surroundings = request.surroundings
    key = f"mujoco world {options.world or ''}"
    world = surroundings.shared.get(key)
    if world is None:
        crowded = bool(surroundings.objects)
        arms = tuple(arm for arm in surroundings.arms if _stands_in(arm, options.world, crowded=crowded))
        world = World(build(arms, surroundings.objects, scene=options.scene), arms=arms, scene=options.scene)
        surroundings.shared[key] = world
    if not isinstance(world, World):
        raise ConfigurationError(f"{request.robot}: {key!r} is no MuJoCo world")
    if world.scene != options.scene:
        raise ConfigurationError(
            f"{request.robot} names the scene {options.scene}, and the others in its MuJoCo world {world.scene}: "
            f"all of them name the same, or each names a world of its own"
        )
    return world


def _stands_in(arm: "SceneArm", world: str | None, *, crowded: bool) -> bool:
    """Whether an arm stands in ``world``; in that without a name are those that have something to touch."""
    if arm.backend != "mujoco" or arm.options.get("world") != world:
        return False
    return world is not None or crowded or arm.options.get("scene") is not None
