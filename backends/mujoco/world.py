"""One MuJoCo world that several arms share, stepped once a cycle for all of them.

Each arm is driven by a controller of its own, whose cycles have a phase of their own. The world goes on when every open
arm has stepped, or when one steps again while others have not: those missed their cycle, and hold what they were told
last. So nobody stops the world, and the same calls in the same order give the same bytes.
"""

from typing import TYPE_CHECKING, Protocol

import mujoco

from backends.mujoco.options import MujocoOptions
from backends.mujoco.scene import STEP_S, build
from hil.values.backend import BackendRequest
from hil.values.errors import BackendError, ConfigurationError

if TYPE_CHECKING:
    from hil.values.surroundings import SceneArm


class Inhabitant(Protocol):
    """An arm in a world."""

    name: str

    def drive(self, share: float) -> None:
        """Give the motors what they give after ``share`` of the cycle; the pose is that of now."""

    def stepped(self) -> None:
        """A cycle is over."""


class World:
    """One model with its data. ``scene`` is the file it was made from."""

    def __init__(self, model: "mujoco.MjModel", *, scene: object) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.scene = scene
        self.cycles = 0
        self._period_ns: int | None = None
        self._inhabitants: list[Inhabitant] = []
        self._stepped: set[str] = set()

    def enter(self, arm: Inhabitant, *, period_ns: int) -> None:
        """An arm is opened; raise :class:`ConfigurationError` for another cycle than the others have."""
        if self._inhabitants and period_ns != self._period_ns:
            raise ConfigurationError(
                f"{arm.name} has a control cycle of {period_ns / 1e6:g} ms, and the others in its MuJoCo world have "
                f"{(self._period_ns or 0) / 1e6:g} ms: set cycle_ms to the same"
            )
        self._period_ns = period_ns
        self._inhabitants.append(arm)

    def leave(self, arm: Inhabitant) -> None:
        """An arm is closed; it holds on with its motors as they are."""
        if arm in self._inhabitants:
            self._inhabitants.remove(arm)
            self._stepped.discard(arm.name)

    def step(self, arm: Inhabitant) -> None:
        """A cycle of ``arm`` is over; let the world go on if it is its turn."""
        if arm.name in self._stepped:
            self._advance()
        self._stepped.add(arm.name)
        if len(self._stepped) == len(self._inhabitants):
            self._advance()

    def _advance(self) -> None:
        self._stepped.clear()
        steps = round((self._period_ns or 0) * 1e-9 / STEP_S)
        before = self.data.time
        for index in range(steps):
            mujoco.mj_step1(self.model, self.data)
            for arm in self._inhabitants:
                arm.drive(index / steps)
            mujoco.mj_step2(self.model, self.data)
        # MuJoCo answers a diverged state by starting over at time zero.
        if self.data.time < before:
            raise BackendError(f"MuJoCo diverged at simulation time {before:.3f} s")
        self.cycles += 1
        for arm in self._inhabitants:
            arm.stepped()


def world_of(request: BackendRequest, options: MujocoOptions) -> World:
    """Return the world an arm stands in: that of all robots with the same ``world``, or one of its own."""
    surroundings = request.surroundings
    key = f"mujoco world {options.world}" if options.world is not None else f"mujoco alone {request.robot}"
    world = surroundings.shared.get(key)
    if world is None:
        arms = tuple(arm for arm in surroundings.arms if _together(arm, request.robot, options.world))
        world = World(build(arms, surroundings.objects, scene=options.scene), scene=options.scene)
        surroundings.shared[key] = world
    if not isinstance(world, World):
        raise ConfigurationError(f"{request.robot}: {key!r} is no MuJoCo world")
    if world.scene != options.scene:
        raise ConfigurationError(
            f"{request.robot} names the scene {options.scene}, and the others in the world {options.world!r} "
            f"{world.scene}: all of them name the same"
        )
    return world


def _together(arm: "SceneArm", robot: str, world: str | None) -> bool:
    return arm.name == robot if world is None else arm.backend == "mujoco" and arm.options.get("world") == world
