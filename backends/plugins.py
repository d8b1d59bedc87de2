"""What this project offers as robot sides; each is imported when one is made."""

from collections.abc import Mapping

from hil.values.arm import Backend, Capabilities
from hil.values.backend import BackendPlugin, BackendRequest, no_options


def _make_ideal(request: BackendRequest) -> Backend:
    from backends.ideal import IdealBackend

    return IdealBackend(request.description)


def _ideal_capabilities() -> Capabilities:
    from backends.ideal import CAPABILITIES

    return CAPABILITIES


def _make_mujoco(request: BackendRequest) -> Backend:
    from backends.mujoco import MujocoBackend
    from backends.mujoco.options import parse_options

    options = parse_options(request.options)
    if options.scene is not None or options.world is not None or request.surroundings.objects:
        from backends.mujoco.scene_arm import SceneArm
        from backends.mujoco.world import world_of

        return SceneArm(request, world_of(request, options))
    return MujocoBackend(request.description, seed=request.seed, load=request.load, torque_noise=request.torque_noise)


def _check_mujoco(options: Mapping[str, object]) -> None:
    from backends.mujoco.options import parse_options

    parse_options(options)


def _mujoco_capabilities() -> Capabilities:
    from backends.mujoco import capabilities

    return capabilities()


IDEAL = BackendPlugin(
    summary="follows every set point exactly, one cycle later: for tests of what is not the arm",
    make=_make_ideal,
    capabilities=_ideal_capabilities,
    check_options=no_options,
)
MUJOCO = BackendPlugin(
    summary="simulated arm with mass, friction, motors, torque sensors and brakes",
    make=_make_mujoco,
    capabilities=_mujoco_capabilities,
    check_options=_check_mujoco,
    options_help={
        "scene": "own MJCF file of the world the arm stands in, at [robot.base]; arms and objects are put into it",
        "world": "name of a world; robots that name the same, or none, stand together where there is a scene",
    },
    needs={"mujoco": "pip install mujoco"},
)
