"""The backend ``elastic``: each axis follows its set point as a damped spring does."""

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from backends.base import InProcessBackend
from hil.values.arm import ArmState, Backend, Capabilities, JointCommand, seven
from hil.values.backend import BackendPlugin, BackendRequest
from hil.values.errors import ConfigurationError
from hil.values.robot import JOINT_COUNT, RobotDescription

STILL = seven([0.0] * JOINT_COUNT)
CAPABILITIES = Capabilities(
    joint_count=JOINT_COUNT,
    takes_torque=False,
    torque_sigma_nm=None,
    can_be_pushed=False,
    shortest_period_ns=1_000_000,
    paces_the_cycle=False,
    moves_real_drives=False,
    switches_drives=True,
)


class Options(BaseModel):
    """``[robot.options]`` of the station file."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    frequency_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 20.0
    damping_ratio: Annotated[float, Field(gt=0.0, le=2.0)] = 1.0


class ElasticBackend(InProcessBackend):
    """Not modelled: mass, gravity, torque, contact, noise."""

    def __init__(self, description: RobotDescription, options: Options) -> None:
        super().__init__()
        self._omega = 2.0 * math.pi * options.frequency_hz
        self._damper = 2.0 * options.damping_ratio * self._omega
        self._position = list(description.initial_position_rad)
        self._velocity = [0.0] * JOINT_COUNT
        self._command = JointCommand(description.initial_position_rad, STILL)
        self._braked = False
        self._milliseconds = 1

    @property
    def capabilities(self) -> Capabilities:
        return CAPABILITIES

    def _open(self, period_ns: int) -> None:
        self._milliseconds = period_ns // 1_000_000
        self._velocity = [0.0] * JOINT_COUNT
        self._command = JointCommand(seven(self._position), STILL)

    def _read(self) -> ArmState:
        position, velocity = seven(self._position), seven(self._velocity)
        return ArmState(position, velocity, STILL, STILL, STILL, self._drive_states, self._sample)

    def _write(self, command: JointCommand) -> None:
        self._command = command

    def _step(self) -> None:
        if self._braked:
            self._velocity = [0.0] * JOINT_COUNT
            return
        for _ in range(self._milliseconds):
            for axis in range(JOINT_COUNT):
                off = self._command.position_rad[axis] - self._position[axis]
                slow = self._command.velocity_rad_s[axis] - self._velocity[axis]
                self._velocity[axis] += (self._omega**2 * off + self._damper * slow) * 1e-3
                self._position[axis] += self._velocity[axis] * 1e-3

    def _apply_brakes(self) -> None:
        self._braked = True
        self._command = JointCommand(seven(self._position), STILL)

    def _release_brakes(self) -> None:
        self._braked = False


def parse_options(options: Mapping[str, object]) -> Options:
    try:
        return Options.model_validate(dict(options))
    except ValidationError as error:
        first = error.errors()[0]
        raise ConfigurationError(f"options of the backend elastic: {first['loc']}: {first['msg']}") from None


def check(options: Mapping[str, object]) -> None:
    parse_options(options)


def make(request: BackendRequest) -> Backend:
    return ElasticBackend(request.description, parse_options(request.options))


PLUGIN = BackendPlugin(
    summary="each axis follows its set point as a damped spring does (an example)",
    make=make,
    capabilities=lambda: CAPABILITIES,
    check_options=check,
    options_help={
        "frequency_hz": "natural frequency of each axis; 20",
        "damping_ratio": "1 (the default): without overshoot",
    },
)
