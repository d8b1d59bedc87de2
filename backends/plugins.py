"""What this project offers as robot sides; each is imported when one is made."""

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

    return MujocoBackend(request.description, seed=request.seed, load=request.load, torque_noise=request.torque_noise)


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
    check_options=no_options,
    needs={"mujoco": "pip install mujoco"},
)
