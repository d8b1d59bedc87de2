"""CoppeliaSim as a renderer: arms of its scene stand as ours do, frames are its dummies, a lost robot is red.

The simulation need not run, and should not where the scene's own scripts move the arms.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from hil.clock import Deadline
from hil.values.errors import ConfigurationError, EndpointError, UnknownName
from hil.values.frames import BASE
from hil.values.robot import JOINT_NAMES
from tools.view.coppelia.arms import SceneArm, find_arms, path_of, poses_at_zero
from tools.view.coppelia.dummies import RobotFrames, draw_frames
from tools.view.coppelia.geometry import Fit, fit_arm
from tools.view.coppelia.joints import Joints
from tools.view.coppelia.link import ANSWER_S, DEFAULT_ADDRESS, LOAD_S, CallRefused, Link
from tools.view.drawing import ArmNow, DrawnRobot
from transport.udp import is_local

RED: Final = (1.0, 0.0, 0.0)
_COMPOUND: Final = "@compound"
"""All parts of a shape at once: three numbers for each."""
_LOOK_S: Final = 1.0
_MOVED_RAD: Final = 1e-6
"""Less is not sent."""


class _Shown:
    """A robot while it is live, and what is to be set back."""

    def __init__(self, arm: SceneArm, fit: Fit, modes: list[tuple[int, int]]) -> None:
        self.arm, self.fit, self.modes = arm, fit, modes
        self.red = False
        self.colours: dict[int, list[float]] = {}
        """Of its shapes before they were red."""


class _Place(NamedTuple):
    device: str
    joint: int
    fit: Fit


class CoppeliaSim:
    """A :class:`tools.view.drawing.Renderer`, and one that takes a changed station without loading its scene anew."""

    title = "CoppeliaSim"

    def __init__(
        self, address: str = DEFAULT_ADDRESS, *, folder: Path | None = None, answer_s: float = ANSWER_S
    ) -> None:
        """``address`` is ``HOST[:PORT]``; a scene is a file, by a path from ``folder``, or a path on another machine.

        Raises :class:`ConfigurationError` for no address, and without the package.
        """
        self.link = Link(address, answer_s=answer_s)
        self.notes: tuple[str, ...] = ()
        """What a person should know of the arms that are shown."""
        self._folder = folder or Path()
        self._scene = ""
        self._robots: tuple[DrawnRobot, ...] = ()
        self._arms: dict[str, SceneArm] = {}
        self._shown: dict[str, _Shown] = {}
        self._places: dict[str, _Place] = {}
        self._joints: Joints | None = None
        self._sent: dict[int, float] = {}
        """What was set last, by joint."""
        self._look_again = Deadline(_LOOK_S)

    def load_scene(self, scene: str, robots: Sequence[DrawnRobot]) -> None:
        """Load a scene file (``.ttt``); the scene that is loaded there is given up, also what was not saved of it."""
        path = self._path(scene)
        self.link.connect()
        if int(self.link.call("getSimulationState")) != self.link.constant("simulation_stopped"):
            raise EndpointError(
                f"a simulation runs in CoppeliaSim at {self.link.address}; stop it, then load the scene"
            )
        self._shown, self._places, self._arms = {}, {}, {}
        self.link.call("loadScene", path, answer_s=LOAD_S)
        self._arms = self._find_arms(scene)
        self._scene, self._robots = scene, tuple(robots)

    def reconfigure(self, robots: Sequence[DrawnRobot]) -> None:
        """Take the robots as they are now, and look which arms the scene has.

        A simulator that was lost is connected again. If it has none of the scene's arms any more, because it was
        started anew, the scene is loaded again; else it stays as it is, with what was done to it.
        """
        again = not self.link.connected
        self.link.connect()
        self._shown, self._places = {}, {}
        known = set(self._arms)
        if again and known.isdisjoint(arm.device for arm in find_arms(self.link).arms):
            self.load_scene(self._scene, robots)
            return
        self._arms = self._find_arms(self._scene)
        self._robots = tuple(robots)

    def devices(self) -> tuple[str, ...]:
        """Return the paths of the scene's arms."""
        return tuple(self._arms)

    def start(self, devices: Mapping[str, str]) -> None:
        """Begin; raise :class:`ConfigurationError` for an arm that is not the robot it is to show, and say how."""
        self.stop()
        robots = {one.name: one for one in self._robots}
        arms = {name: self._arm(device) for name, device in devices.items()}
        fits = {}
        for name, arm in arms.items():
            fits[name] = fit_arm(poses_at_zero(self.link, arm), model=robots[name].model, device=arm.device, robot=name)
        self._joints, self._sent = None, {}
        kinematic = self.link.constant("jointmode_kinematic", "jointmode_passive")
        for name, arm in arms.items():
            modes = [self._mode(joint) for joint in arm.joints]
            self._shown[name] = _Shown(arm, fits[name], modes)
            for joint in arm.joints:
                self.link.call("setJointMode", joint, kinematic, 0)
            self._joints = self._joints or Joints(self.link, arm.joints[0])
        self._places = {name: _Place(arm.device, arm.joints[-1], fits[name]) for name, arm in arms.items()}
        self.notes = tuple(
            f"{joint} of {arm.device} turns the other way than ours; it is shown with its sign"
            for name, arm in arms.items()
            for joint, sign in zip(JOINT_NAMES, fits[name].signs, strict=True)
            if sign < 0
        )

    def show(self, robots: Mapping[str, ArmNow]) -> None:
        """Set the joints that moved, and the colours of what was lost or is back.

        While nothing moves it asks once a second whether simulator and scene are still there.
        """
        if (self._look_again.left_s() or 0.0) <= 0.0:
            self._require_scene()
        moved: dict[int, float] = {}
        for name, shown in self._shown.items():
            now = robots.get(name)
            if now is None:
                continue
            if now.snapshot is not None:
                moved |= self._moved(shown, now.snapshot.measured_position)
            if bool(now.lost) is not shown.red:
                (self._make_red if now.lost else self._restore)(shown)
        if moved and self._joints is not None:
            self._joints.set(list(moved.items()))
            self._sent |= moved

    def synchronise_frames(self) -> int:
        """Draw the frames; those that move with a flange once the robot was live."""
        drawn = {}
        for one in self._robots:
            place = self._places.get(one.name)
            drawn[one.name] = (
                RobotFrames(one.frames, one.frames[BASE].in_parent)
                if place is None
                else RobotFrames(one.frames, place.fit.base_in_world, place.joint, place.fit.flange_in_last_joint)
            )
        return draw_frames(self.link, drawn)

    def stop(self) -> None:
        """Give the arms back: colours and joint modes as they were, positions as they are."""
        ended, self._shown = self._shown, {}
        for shown in ended.values():
            self._restore(shown)
            for joint, (mode, options) in zip(shown.arm.joints, shown.modes, strict=True):
                self.link.call("setJointMode", joint, mode, options)

    def close(self) -> None:
        """End the live view and the connection."""
        with suppress(EndpointError):
            self.stop()
        self.link.close()

    def kept_name(self, scene: Path) -> str:
        """Return what a scene file is called in the choices: by its path from ``folder`` where it is below that.

        Raises :class:`ConfigurationError` for a file that is not there, where that can be known.
        """
        if not self._on_this_machine():
            return str(scene)
        whole, folder = _existing(scene), self._folder.resolve()
        return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)

    def _path(self, scene: str) -> str:
        """Return the scene's path as the simulator is to have it."""
        return str(_existing(self._folder / scene)) if self._on_this_machine() else scene

    def _on_this_machine(self) -> bool:
        return is_local(self.link.address.rpartition(":")[0])

    def _find_arms(self, scene: str) -> dict[str, SceneArm]:
        found = find_arms(self.link)
        if not found.arms:
            others = f"; it has {', '.join(found.others)}" if found.others else ""
            raise ConfigurationError(
                f"the scene {scene} has no arm: no model with a chain of seven revolute joints{others}"
            )
        return {arm.device: arm for arm in found.arms}

    def _arm(self, device: str) -> SceneArm:
        try:
            return self._arms[device]
        except KeyError:
            raise UnknownName("robot of the scene", device, self._arms) from None

    def _require_scene(self) -> None:
        """Raise :class:`EndpointError` where the simulator is gone, or has other objects than were found."""
        self._look_again.restart()
        for shown in self._shown.values():
            try:
                path = path_of(self.link, shown.arm.model)
            except CallRefused:
                path = ""
            if path != shown.arm.device:
                raise CallRefused(
                    f"{shown.arm.device} is not in the scene any more that CoppeliaSim at {self.link.address} has "
                    f"loaded; load {self._scene} again"
                )

    def _mode(self, joint: int) -> tuple[int, int]:
        mode, options = self.link.call("getJointMode", joint)
        return int(mode), int(options)

    def _moved(self, shown: _Shown, position_rad: Sequence[float]) -> dict[int, float]:
        """Return the joints that are not where they were set last, by handle."""
        wanted = {
            joint: sign * angle
            for joint, sign, angle in zip(shown.arm.joints, shown.fit.signs, position_rad, strict=True)
        }
        return {
            joint: angle for joint, angle in wanted.items() if abs(angle - self._sent.get(joint, math.inf)) > _MOVED_RAD
        }

    def _make_red(self, shown: _Shown) -> None:
        shape = self.link.constant("sceneobject_shape", "object_shape_type")
        part = self.link.constant("colorcomponent_ambient_diffuse")
        for handle in self.link.call("getObjectsInTree", shown.arm.model, shape, 0):
            _, colours = self.link.call("getShapeColor", handle, _COMPOUND, part)
            shown.colours[handle] = list(colours)
            self.link.call("setShapeColor", handle, _COMPOUND, part, [*RED] * (len(colours) // 3))
        shown.red = True

    def _restore(self, shown: _Shown) -> None:
        colours, shown.colours = shown.colours, {}
        for handle, before in colours.items():
            part = self.link.constant("colorcomponent_ambient_diffuse")
            self.link.call("setShapeColor", handle, _COMPOUND, part, before)
        shown.red = False


def _existing(scene: Path) -> Path:
    path = scene.resolve()
    if not path.is_file():
        raise ConfigurationError(f"there is no scene file {path}")
    return path
