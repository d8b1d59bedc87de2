"""The frames of robots as dummies of a CoppeliaSim scene (manual 6.4).

Frames that stand still hang below one dummy of the scene, those that move with a flange below one of the same name on
that arm's last joint, so they follow it by themselves. What is there already is moved, not made anew, because a user's
own objects may hang on it; only our own are removed.
"""

import re
from collections.abc import Mapping
from typing import Final, NamedTuple

from hil.values.frames import BASE, FrameTree
from hil.values.pose import NOWHERE, Pose
from tools.view.coppelia.arms import NOBODY, numbers_of
from tools.view.coppelia.link import Link

GROUP: Final = "fri-hil frames"
_SIZE_M: Final = 0.02


class RobotFrames(NamedTuple):
    """The frames of one robot, and where the scene has it."""

    frames: FrameTree
    base_in_world: Pose
    last_joint: int = NOBODY
    """Handle of A7; NOBODY for a robot that no arm of the scene shows, whose moving frames have no place."""
    flange_in_last_joint: Pose = NOWHERE


def draw_frames(link: Link, robots: Mapping[str, RobotFrames]) -> int:
    """Draw them all anew, remove those that are gone, and return how many are drawn."""
    dummies = _Dummies(link)
    group = dummies.put(GROUP, NOBODY, NOWHERE)
    count = 0
    for name, robot in robots.items():
        count += _draw(dummies, dummies.put(name, group, robot.base_in_world), robot)
    dummies.remove_others()
    return count


def _draw(dummies: "_Dummies", standing: int, robot: RobotFrames) -> int:
    moving = NOBODY
    if robot.last_joint != NOBODY:
        moving = dummies.put(GROUP, robot.last_joint, robot.flange_in_last_joint, reference=robot.last_joint)
    count = 0
    for name, frame in robot.frames.items():
        if not frame.moves:
            in_base = NOWHERE if name == BASE else robot.frames.in_base(name)
            dummies.put(name, standing, robot.base_in_world @ in_base)
        elif moving != NOBODY:
            in_joint = robot.flange_in_last_joint @ robot.frames.in_flange(name)
            dummies.put(name, moving, in_joint, reference=robot.last_joint)
        else:
            continue
        count += 1
    return count


class _Dummies:
    """The dummies of a scene, by parent and name; those that nobody put are removed where they are ours."""

    def __init__(self, link: Link) -> None:
        self._link = link
        kind = link.constant("sceneobject_dummy", "object_dummy_type")
        handles = [int(one) for one in link.call("getObjectsInTree", link.constant("handle_scene"), kind, 0)]
        self._parents = {one: int(link.call("getObjectParent", one)) for one in handles}
        self._names = {one: _plain(str(link.call("getObjectAlias", one, -1))) for one in handles}
        self._put: set[int] = set()

    def put(self, name: str, parent: int, pose: Pose, *, reference: int = NOBODY) -> int:
        """Have a dummy below ``parent`` stand at ``pose`` in the reference, by default the world; return its handle."""
        plain = _plain(name)
        found = (one for one, above in self._parents.items() if above == parent and self._names[one] == plain)
        handle = next((one for one in found if one not in self._put), NOBODY)
        if handle == NOBODY:
            handle = int(self._link.call("createDummy", _SIZE_M))
            self._link.call("setObjectAlias", handle, name)
            if parent != NOBODY:
                self._link.call("setObjectParent", handle, parent, True)
            self._parents[handle], self._names[handle] = parent, plain
        self._put.add(handle)
        self._link.call("setObjectPose", handle, numbers_of(pose), reference)
        return handle

    def remove_others(self) -> None:
        group = _plain(GROUP)
        groups = {one for one, name in self._names.items() if name == group and one not in self._foreign_groups()}
        standing = {one for one in groups if self._parents[one] == NOBODY}
        robots = {one for one, above in self._parents.items() if above in standing}
        ours = groups | robots | {one for one, above in self._parents.items() if above in groups | robots}
        gone = sorted(ours - self._put)
        if gone:
            self._link.call("removeObjects", gone)

    def _foreign_groups(self) -> set[int]:
        """Return dummies that are named as ours but hang below another dummy: a user's."""
        return {one for one, above in self._parents.items() if above in self._parents}


def _plain(name: str) -> str:
    # Releases differ in which characters they let stand in a name, and put others in their place.
    return re.sub(r"[\W_]", "", name).casefold()
