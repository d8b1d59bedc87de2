"""The page's scene as a renderer: robots, what stands around them, frames."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from hil.values.errors import ConfigurationError, UnknownName
from tools.view.browser.arm_drawing import ArmDrawing
from tools.view.browser.choice import Shown
from tools.view.browser.surroundings import draw_surroundings
from tools.view.drawing import ArmNow, DrawnRobot

STATION_SCENE = "station"
"""What stands around the robots in their station; the other scene is an empty floor."""
EMPTY_SCENE = "empty"
_FLOOR_M = 4.0
_CELL_M = 0.1


class BrowserRenderer:
    """Draws in the scene of a viser server. Its devices are the robots themselves."""

    title = "browser"

    def __init__(self, server: "viser.ViserServer", objects: Sequence[Mapping[str, Any]]) -> None:
        self._server = server
        self._objects = tuple(objects)
        self._robots: tuple[DrawnRobot, ...] = ()
        self._arms: dict[str, ArmDrawing] = {}
        self._live = False
        self._frames_drawn = False
        self.shown = Shown()
        self.started: Callable[[], object] = lambda: None
        """Called when the live view began anew."""
        scene = server.scene
        scene.set_up_direction("+z")
        # Shadows and reflections halve the frames a second where the browser has no GPU.
        scene.configure_environment_map(hdri=None)
        scene.configure_default_lights(enabled=False, cast_shadow=False)
        scene.add_light_ambient("/lights/all_around", color=(255, 255, 255), intensity=1.3)
        scene.add_light_directional(
            "/lights/lamp", color=(255, 252, 245), intensity=2.2, cast_shadow=False, position=(2.0, -1.5, 3.5)
        )
        scene.add_light_directional(
            "/lights/window", color=(235, 242, 255), intensity=0.9, cast_shadow=False, position=(-2.0, 2.5, 1.0)
        )
        scene.add_grid(
            "/floor", width=_FLOOR_M, height=_FLOOR_M, cell_size=_CELL_M, section_size=1.0, cell_color=(225, 228, 232)
        )

    def surrounded_by(self, objects: Sequence[Mapping[str, Any]]) -> None:
        """These are what stands around the robots, from the next time that a scene is loaded."""
        self._objects = tuple(objects)

    def load_scene(self, scene: str, robots: Sequence[DrawnRobot]) -> None:
        """Draw what stands around the robots: ``station`` or ``empty``; raise :class:`UnknownName`."""
        if scene not in {STATION_SCENE, EMPTY_SCENE}:
            raise UnknownName("scene", scene, [STATION_SCENE, EMPTY_SCENE])
        self.stop()
        self._robots = tuple(robots)
        draw_surroundings(self._server.scene, self._objects if scene == STATION_SCENE else ())

    def devices(self) -> tuple[str, ...]:
        """Return the robots, which are there whatever the scene."""
        return tuple(robot.name for robot in self._robots)

    def start(self, devices: Mapping[str, str]) -> None:
        """Draw the robots from now on."""
        for name, device in devices.items():
            if device not in self.devices():
                raise ConfigurationError(f"{name} cannot be {device!r}; valid: {', '.join(self.devices())}")
        self.stop()
        with self._server.atomic():
            for robot in self._robots:
                if robot.name in devices:
                    self._arms[robot.name] = ArmDrawing(self._server.scene, robot, self.shown)
        self._live = True
        if self._frames_drawn:
            self.synchronise_frames()
        self.started()

    def show(self, robots: Mapping[str, ArmNow]) -> None:
        """Draw the robots as they are now."""
        if not self._live:
            return
        with self._server.atomic():
            for name, arm in self._arms.items():
                if name in robots:
                    arm.show(robots[name])

    def synchronise_frames(self) -> int:
        """Draw the frames of the station anew, and return how many there are."""
        self._frames_drawn = True
        return sum(arm.synchronise_frames(arm.robot.frames) for arm in self._arms.values())

    def stop(self) -> None:
        """Draw no robots any more; what stands around them stays."""
        self._live = False
        for arm in self._arms.values():
            arm.remove()
        self._arms.clear()

    def close(self) -> None:
        """Nothing to let go of: the server is its owner's."""
        self.stop()

    @property
    def arms(self) -> Mapping[str, ArmDrawing]:
        """The robots that are drawn, by name."""
        return self._arms

    def clear_trails(self) -> None:
        """Forget where the flanges were."""
        for arm in self._arms.values():
            arm.clear_trail()

    def choose(self) -> None:
        """What is to be shown was chosen anew."""
        for arm in self._arms.values():
            arm.choose()
