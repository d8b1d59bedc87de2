"""Which arms a scene of CoppeliaSim has: models with a chain of seven revolute joints, base to flange.

A joint is known by where it hangs, never by its name: in the simulator's own model of the iiwa most are ``joint``.
"""

from functools import cache
from typing import NamedTuple

from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT
from tools.view.coppelia.link import Link

_SHORT_PATH = 1
"""Of sim.getObjectAlias: a path that names one object of the scene only."""
NOBODY = -1
"""Handle of no object; as a parent, and as the reference of a pose, it is the world."""


class SceneArm(NamedTuple):
    """An arm of the scene, by the simulator's numbers of its objects."""

    device: str
    """Path of its model, which names it for a person."""
    model: int
    joints: tuple[int, ...]
    """A1 to A7."""


class SceneArms(NamedTuple):
    """What was found."""

    arms: tuple[SceneArm, ...]
    others: tuple[str, ...]
    """Chains of another length, in words."""


def find_arms(link: Link) -> SceneArms:
    """Walk the tree of the scene; a few round trips a joint."""
    arms, others = [], []
    for model, chain in _chains(link):
        path = path_of(link, model)
        if len(chain) == JOINT_COUNT:
            arms.append(SceneArm(path, model, tuple(chain)))
        else:
            others.append(f"{path} with {len(chain)}")
    return SceneArms(tuple(sorted(arms)), tuple(sorted(others)))


def path_of(link: Link, handle: int) -> str:
    """Return the short path of an object, which no other one has."""
    return str(link.call("getObjectAlias", handle, _SHORT_PATH))


def poses_at_zero(link: Link, arm: SceneArm) -> tuple[Pose, ...]:
    """Return where the joints stand in the world when all are at 0, wherever they are now.

    A joint's pose in the one before it is told from that one's moving side, so it never changes.
    """
    stands = pose_of(link.call("getObjectPose", arm.joints[0], NOBODY))
    poses = [stands]
    for inner, outer in zip(arm.joints, arm.joints[1:], strict=False):
        stands @= pose_of(link.call("getObjectPose", outer, inner))
        poses.append(stands)
    return tuple(poses)


def pose_of(numbers: list[float]) -> Pose:
    """Return a pose of CoppeliaSim: x, y, z in m and a quaternion x, y, z, w."""
    x_m, y_m, z_m, x, y, z, w = numbers
    return Pose.from_quaternion((x_m, y_m, z_m), (w, x, y, z))


def numbers_of(pose: Pose) -> list[float]:
    """Return what CoppeliaSim takes for a pose, as :func:`pose_of`."""
    w, x, y, z = pose.quaternion_wxyz()
    return [*pose.position_m, x, y, z, w]


def _chains(link: Link) -> list[tuple[int, list[int]]]:
    """Return the chains of revolute joints within one model each, with the model."""
    joint_type = link.constant("sceneobject_joint", "object_joint_type")
    revolute = link.constant("joint_revolute", "joint_revolute_subtype")
    not_a_model = link.constant("modelproperty_not_model")
    joints = [int(one) for one in link.call("getObjectsInTree", link.constant("handle_scene"), joint_type, 0)]

    @cache
    def parent(handle: int) -> int:
        return int(link.call("getObjectParent", handle))

    @cache
    def is_model(handle: int) -> bool:
        return not int(link.call("getModelProperty", handle)) & not_a_model

    def ancestors(handle: int) -> list[int]:
        found = []
        while (handle := parent(handle)) != NOBODY:
            found.append(handle)
        return found

    def model(handle: int) -> int:
        above = ancestors(handle)
        return next((one for one in above if is_model(one)), above[-1] if above else handle)

    turning = {one: model(one) for one in joints if int(link.call("getJointType", one)) == revolute}
    next_ones: dict[int, list[int]] = {one: [] for one in turning}
    heads = []
    for one, of in turning.items():
        above = next((upper for upper in ancestors(one) if upper in joints), NOBODY)
        if turning.get(above) == of:
            next_ones[above].append(one)
        else:
            heads.append(one)
    chains = []
    for head in heads:
        chain = [head]
        while len(next_ones[chain[-1]]) == 1:
            chain += next_ones[chain[-1]]
        chains.append((turning[head], chain))
    return chains
