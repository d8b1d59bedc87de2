"""One MuJoCo model of several arms, what they carry, and what they can touch.

The arms' own files have nothing that collides, because Pinocchio reads them too; here each link gets a massless
capsule, and a mounted tool a rod to each of its frames. An arm does not collide with itself. Radii are ours, by eye.
"""

from pathlib import Path
from typing import Any, Final

import mujoco

from backends.mujoco.backend import STEP_NS
from backends.mujoco.load import hang
from backends.robots import mjcf_path
from backends.robots.facts import GRAVITY_M_S2
from hil.values.errors import ConfigurationError
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, Three
from hil.values.surroundings import SceneArm, SceneObject, Shape

_LINK_RADII_M: Final = (0.075, 0.075, 0.07, 0.07, 0.06, 0.055)
_FLANGE_RADIUS_M: Final = 0.0315
_BASE_RADIUS_M: Final = 0.085
_TOOL_RADIUS_M: Final = 0.01
_SHORTEST_TOOL_M: Final = 1e-3
_GROUP: Final = 3
"""Geoms that are there to collide; a viewer hides them."""
_SHOWN_GROUP: Final = 2
_OBJECT_BIT: Final = 1 << 30
_GRAVITY: Final = (0.0, 0.0, -GRAVITY_M_S2)
_UP: Final = Pose(0.0, 0.0, 1.0)
_UPRIGHT: Final = 1.0 - 1e-9
_ARM_FRICTION: Final = (0.1, 0.005, 0.0001)
"""Little, because MuJoCo takes the larger of two: so it is the object's that counts."""
_ALL_BITS: Final = (1 << 31) - 1
_MOST_ARMS: Final = 16
_TYPES: Final = {
    Shape.BOX: mujoco.mjtGeom.mjGEOM_BOX,
    Shape.CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER,
    Shape.SPHERE: mujoco.mjtGeom.mjGEOM_SPHERE,
    Shape.PLANE: mujoco.mjtGeom.mjGEOM_PLANE,
}


def prefix_of(arm: str) -> str:
    """Return what the names of an arm's parts begin with in the model."""
    return f"{arm}/"


def build(arms: tuple[SceneArm, ...], objects: tuple[SceneObject, ...], *, scene: Path | None) -> "mujoco.MjModel":
    """Return the model of ``arms`` and ``objects``, in the world of the MJCF file ``scene`` where there is one.

    Raises :class:`ConfigurationError` in one sentence for what MuJoCo does not take.
    """
    if len(arms) > _MOST_ARMS:
        raise ConfigurationError(f"{len(arms)} arms in one MuJoCo world, {_MOST_ARMS} at most")
    for arm in arms:
        if (arm.base_in_world @ _UP).z_m - arm.base_in_world.z_m < _UPRIGHT:
            raise ConfigurationError(
                f"the base of {arm.name} leans: in a scene an arm stands upright, b_deg and c_deg are 0"
            )
    spec = _world(scene)
    gravity = tuple(map(float, spec.option.gravity))
    if gravity != _GRAVITY:
        raise ConfigurationError(
            f"the scene file {scene} has the gravity {gravity}, and these arms know {_GRAVITY} m/s2 alone"
        )
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    spec.option.timestep = STEP_NS * 1e-9
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    try:
        for number, arm in enumerate(arms):
            _attach(spec, arm, number)
        for one in objects:
            _add_object(spec, one)
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        where = "" if scene is None else f" {scene}"
        raise ConfigurationError(f"MuJoCo does not take the scene{where}: {_first_line(error)}") from error
    for arm in arms:
        hang(arm.load, model, prefix=prefix_of(arm.name))
    return model


def _world(scene: Path | None) -> "mujoco.MjSpec":
    if scene is None:
        return mujoco.MjSpec()
    try:
        return mujoco.MjSpec.from_file(str(scene))
    except (ValueError, mujoco.FatalError) as error:
        raise ConfigurationError(f"the scene file {scene} is no MJCF: {_first_line(error)}") from error


def _attach(spec: "mujoco.MjSpec", arm: SceneArm, number: int) -> None:
    robot = mujoco.MjSpec.from_file(str(mjcf_path(arm.model)))
    bits: dict[str, Any] = {
        "contype": 2 << number,
        "conaffinity": _ALL_BITS ^ (2 << number),
        "group": _GROUP,
        "mass": 0.0,
        "friction": _ARM_FRICTION,
    }
    bodies = [robot.body(f"link_{link}") for link in range(1, JOINT_COUNT + 1)]
    ends = [*(body.pos[2] for body in bodies), robot.site("flange").pos[2]]
    for body, radius, length in zip(
        [robot.worldbody, *bodies[:-1]], (_BASE_RADIUS_M, *_LINK_RADII_M), ends[:-1], strict=True
    ):
        _capsule(body, radius, (0.0, 0.0, float(length)), bits)
    flange = float(ends[-1])
    # A cylinder, because the face of the flange is flat: what it presses on is where the flange is.
    bodies[-1].add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=(0.0, 0.0, 0.0, 0.0, 0.0, flange),
        size=(_FLANGE_RADIUS_M, 0.0, 0.0),
        **bits,
    )
    for x, y, z in arm.touches_m:
        if max(abs(x), abs(y), abs(z)) > _SHORTEST_TOOL_M:
            rod = {**bits, "group": _SHOWN_GROUP}
            _capsule(bodies[-1], _TOOL_RADIUS_M, (x, y, flange + z), rod, begin=(0.0, 0.0, flange))
    pose = arm.base_in_world
    frame = spec.worldbody.add_frame(pos=pose.position_m, quat=pose.quaternion_wxyz())
    spec.attach(robot, prefix=prefix_of(arm.name), frame=frame)


def _capsule(
    body: "mujoco.MjsBody", radius_m: float, end_m: Three, bits: dict[str, Any], *, begin: Three = (0.0, 0.0, 0.0)
) -> None:
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=(*begin, *end_m), size=(radius_m, 0.0, 0.0), **bits)


def _add_object(spec: "mujoco.MjSpec", one: SceneObject) -> None:
    body = spec.worldbody.add_body(name=one.name, pos=one.pose.position_m, quat=one.pose.quaternion_wxyz())
    if one.mass_kg is not None:
        body.add_freejoint(name=one.name)
    body.add_geom(
        name=one.name,
        type=_TYPES[one.shape],
        size=_half_sizes(one),
        friction=(one.friction, 0.005, 0.0001),
        rgba=(*one.colour, 1.0),
        contype=_OBJECT_BIT,
        conaffinity=_ALL_BITS,
        **({} if one.mass_kg is None else {"mass": one.mass_kg}),
    )


def _half_sizes(one: SceneObject) -> Three:
    half = [0.5 * size for size in one.size_m]
    match one.shape:
        case Shape.BOX:
            return half[0], half[1], half[2]
        case Shape.CYLINDER:
            return half[0], half[1], 0.0
        case Shape.SPHERE:
            return half[0], 0.0, 0.0
        case Shape.PLANE:
            return 0.0, 0.0, 1.0


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
