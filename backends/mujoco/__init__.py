"""The MuJoCo arm: torque-driven joints under a position controller."""

from backends.mujoco.backend import MujocoBackend, capabilities

__all__ = ["MujocoBackend", "capabilities"]
