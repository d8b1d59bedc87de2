"""One robot in the page: its links, the ghost of its set point, the flange's trail, its frames, forces and name."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import viser

from backends.robots.visual import visual_parts
from hil.values.frames import BASE, FLANGE, WORLD, Frame, FrameTree
from hil.values.pose import NOWHERE, Pose
from hil.values.robot import Three
from hil.values.servo import Snapshot
from tools.view.browser.choice import Shown
from tools.view.drawing import ArmNow, DrawnRobot
from tools.view.link_poses import LINKS, LinkPose, LinkPoses

_GHOST: Final = (70, 130, 255)
_GHOST_OPACITY: Final = 0.35
_LOST: Final = (205, 45, 40)
_TRAIL: Final = (255, 120, 0)
_FORCE: Final = (20, 150, 70)
_CONTACT: Final = (215, 30, 120)
_TRAIL_POINTS: Final = 125
_TRAIL_STEP_M: Final = 0.008
"""Each point is drawn by the browser and sent anew with each new one; a finer trail looks the same."""
_SHOWN_GHOST_RAD: Final = math.radians(0.25)
"""How far the set point must be from the measured position to be drawn beside it."""
_STILL_RAD: Final = 2e-5
_M_PER_N: Final = 0.004
_LEAST_FORCE_N: Final = 1.0
_LONGEST_ARROW_M: Final = 0.6
_NO_ARROW: Final = np.zeros((1, 2, 3))


class ArmDrawing:
    """Draws below ``/NAME`` of the scene; calls come from one thread."""

    def __init__(self, scene: "viser.SceneApi", robot: DrawnRobot, shown: Shown) -> None:
        self.robot = robot
        self._scene = scene
        self._shown = shown
        self._root = f"/{robot.name}"
        self._poses = LinkPoses(robot.model)
        base = self.base_in_world = robot.frames[BASE].in_parent
        self._base = scene.add_frame(self._root, show_axes=False, position=base.position_m, wxyz=base.quaternion_wxyz())
        self._parts: list[tuple[Any, tuple[int, int, int]]] = []
        self._links = [self._link(link) for link in range(LINKS)]
        self._ghosts = [self._link(link, "set_point") for link in range(LINKS)]
        self._add_parts()
        self._label = scene.add_label(f"{self._root}/name", robot.name, position=(0.0, 0.0, -0.04))
        self._trail: deque[Three] = deque(maxlen=_TRAIL_POINTS)
        self._trail_line: Any = None
        self._force = self._arrows("force", _FORCE)
        self._contacts = self._arrows("contacts", _CONTACT)
        self._axes: list[Any] = []
        self._drawn: Sequence[float] | None = None
        self._ghost_drawn: Sequence[float] | None = None
        self._lost = ""
        self.flange = scene.add_icosphere(
            f"{self._root}/grip", radius=0.055, color=(255, 120, 0), opacity=0.0, cast_shadow=False
        )
        """What a hand takes hold of; it is not seen."""

    def show(self, now: ArmNow) -> None:
        """Draw it as it is now."""
        if now.lost != self._lost:
            self._colour(now.lost)
        snapshot = now.snapshot
        if snapshot is None:
            return
        measured = snapshot.measured_position
        if _differ(self._drawn, measured, by_rad=_STILL_RAD):
            self._drawn = measured
            _place(self._links, self._poses.at(measured))
            flange = self._poses.flange_m()
            self.flange.position = flange
            self._draw_trail(flange)
            for axes, frame in self._axes:
                if frame.moves:
                    _put(axes, snapshot.flange_in_base @ self.robot.frames.in_flange(frame.name))
        self._draw_ghost(snapshot)
        self._draw_forces(snapshot)

    def synchronise_frames(self, frames: FrameTree) -> int:
        """Draw the station's frames anew; return how many there are."""
        self.remove_frames()
        for frame in frames.values():
            if frame.name in {WORLD, BASE}:
                continue
            axes = self._scene.add_frame(
                f"{self._root}/frames/{frame.name}",
                axes_length=0.12 if frame.name != FLANGE else 0.15,
                axes_radius=0.004,
                origin_radius=0.008,
                visible=self._shown.frames,
            )
            self._scene.add_label(f"{self._root}/frames/{frame.name}/name", frame.name, position=(0.0, 0.0, 0.02))
            self._axes.append((axes, frame))
            _put(axes, self._frame_in_base(frames, frame))
        return len(self._axes)

    def remove_frames(self) -> None:
        """Draw no frames."""
        for axes, _ in self._axes:
            axes.remove()
        self._axes.clear()

    def choose(self) -> None:
        """What is to be shown was chosen anew."""
        for axes, _ in self._axes:
            axes.visible = self._shown.frames
        if self._trail_line is not None:
            self._trail_line.visible = self._shown.trail
        for arrows in (self._force, self._contacts):
            arrows.visible = self._shown.forces
        self._ghost_drawn = None

    def clear_trail(self) -> None:
        """Forget where the flange was."""
        self._trail.clear()
        if self._trail_line is not None:
            self._trail_line.remove()
            self._trail_line = None

    def remove(self) -> None:
        """Draw nothing of it any more."""
        self._base.remove()

    def _link(self, link: int, of: str = "") -> Any:
        return self._scene.add_frame(f"{self._root}{of and '/' + of}/link_{link}", show_axes=False, visible=not of)

    def _add_parts(self) -> None:
        parts = visual_parts(self.robot.model)
        for number, part in enumerate(parts):
            colour = _bytes(part.colour)
            mesh = self._scene.add_mesh_simple(
                f"{self._root}/link_{part.body}/part_{number}",
                np.asarray(part.vertices, np.float32),
                np.asarray(part.faces, np.uint32),
                color=colour,
            )
            self._parts.append((mesh, colour))
        for link in range(LINKS):
            own = [part for part in parts if part.body == link]
            if not own:
                continue
            offsets = np.cumsum([0, *(len(part.vertices) for part in own)])
            self._scene.add_mesh_simple(
                f"{self._root}/set_point/link_{link}/shell",
                np.concatenate([part.vertices for part in own]).astype(np.float32),
                np.concatenate([part.faces + offset for part, offset in zip(own, offsets[:-1], strict=True)]).astype(
                    np.uint32
                ),
                color=_GHOST,
                opacity=_GHOST_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )

    def _arrows(self, name: str, colour: tuple[int, int, int]) -> Any:
        return self._scene.add_arrows(
            f"{self._root}/{name}", _NO_ARROW, colors=colour, shaft_radius=0.006, head_radius=0.016, head_length=0.04
        )

    def _draw_ghost(self, snapshot: Snapshot) -> None:
        set_point = snapshot.commanded_position
        wanted = self._shown.set_point and _differ(snapshot.measured_position, set_point, by_rad=_SHOWN_GHOST_RAD)
        if not wanted:
            if self._ghosts[0].visible:
                for link in self._ghosts:
                    link.visible = False
            self._ghost_drawn = None
        elif _differ(self._ghost_drawn, set_point, by_rad=_STILL_RAD):
            if self._ghost_drawn is None:
                for link in self._ghosts:
                    link.visible = True
            self._ghost_drawn = set_point
            _place(self._ghosts, self._poses.at(set_point))

    def _draw_trail(self, flange: Three) -> None:
        if self._trail and math.dist(self._trail[-1], flange) < _TRAIL_STEP_M:
            return
        self._trail.append(flange)
        if len(self._trail) < 2:
            return
        points = np.array(self._trail, np.float32)
        lines = np.stack([points[:-1], points[1:]], axis=1)
        if self._trail_line is None:
            self._trail_line = self._scene.add_line_segments(
                f"{self._root}/trail", lines, _TRAIL, thickness=2.5, thickness_units="screen", visible=self._shown.trail
            )
        else:
            self._trail_line.points = lines

    def _draw_forces(self, snapshot: Snapshot) -> None:
        if not self._shown.forces:
            return
        force = snapshot.flange_force[:3]
        flange = snapshot.flange_in_base.position_m
        _aim(self._force, [(flange, force)] if math.hypot(*force) >= _LEAST_FORCE_N else [])
        _aim(self._contacts, [(one.point_m, one.force_n) for one in snapshot.contacts])

    def _frame_in_base(self, frames: FrameTree, frame: Frame) -> Pose:
        if not frame.moves:
            return frames.in_base(frame.name)
        self._drawn = None
        return NOWHERE

    def _colour(self, lost: str) -> None:
        self._lost = lost
        for mesh, colour in self._parts:
            mesh.color = _LOST if lost else colour
        self._label.text = f"{self.robot.name}: lost" if lost else self.robot.name


def _bytes(colour: Three) -> tuple[int, int, int]:
    red, green, blue = colour
    return round(255 * red), round(255 * green), round(255 * blue)


def _differ(before: Sequence[float] | None, now: Sequence[float], *, by_rad: float) -> bool:
    return before is None or any(abs(old - new) > by_rad for old, new in zip(before, now, strict=True))


def _place(links: Sequence[Any], poses: Sequence[LinkPose]) -> None:
    for link, pose in zip(links, poses, strict=True):
        link.position, link.wxyz = pose


def _put(axes: Any, pose: Pose) -> None:
    axes.position, axes.wxyz = pose.position_m, pose.quaternion_wxyz()


def _aim(arrows: Any, forces: Sequence[tuple[Three, Sequence[float]]]) -> None:
    """Let the arrows end where the forces act, as long as they are strong."""
    if not forces:
        if np.any(arrows.points):
            arrows.points = _NO_ARROW
        return
    ends = []
    for point, force in forces:
        strength = math.hypot(*force)
        length = min(strength * _M_PER_N, _LONGEST_ARROW_M)
        ends.append(([at - part * length / strength for at, part in zip(point, force, strict=True)], list(point)))
    arrows.points = np.array(ends, np.float32)
