"""``[robot.limits]``: limits of a robot, tightened by its station. What would widen one is refused."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from hil.core.settings import T1_SPEED_LIMIT_MM_S, TRACKING_LIMIT_RAD, SafetySettings
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.robot import JOINT_NAMES, RobotDescription, Seven

LEAST: Final = 0.1
"""Degrees a second, Nm, and degrees of a range: with less an axis cannot work."""

AxisValues = Annotated[list[float] | None, Field(min_length=7, max_length=7)]


class LimitsConfig(BaseModel):
    """Seven numbers each, axis A1 first; what is left out stays as the robot has it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    position_min_deg: Annotated[AxisValues, Field(description="lower ends of the axis ranges, degrees")] = None
    position_max_deg: Annotated[AxisValues, Field(description="upper ends of the axis ranges, degrees")] = None
    velocity_deg_s: Annotated[AxisValues, Field(description="axis velocities, degrees a second")] = None
    torque_nm: Annotated[AxisValues, Field(description="axis torques, Nm")] = None
    t1_flange_speed_mm_s: Annotated[
        float, Field(ge=1.0, le=T1_SPEED_LIMIT_MM_S, description="speed of the flange in T1, 1 ... 250 mm/s")
    ] = T1_SPEED_LIMIT_MM_S
    tracking_deg: Annotated[
        float | None, Field(ge=0.01, description="distance of a measured axis from its set point, 0.01 ... 5.7 degrees")
    ] = None

    def settings(self, *, permissive: bool) -> SafetySettings:
        """Return what is not an axis's own."""
        tracking_rad = TRACKING_LIMIT_RAD if self.tracking_deg is None else math.radians(self.tracking_deg)
        return SafetySettings(self.t1_flange_speed_mm_s, tracking_rad, permissive)

    def tighten(self, robot: RobotDescription) -> RobotDescription:
        """Return ``robot`` with these limits; raise :class:`ConfigurationError` for one that is wider than its own."""
        own = robot.limits
        low = _tightened("position_min_deg", self.position_min_deg, own.position_min_rad, math.degrees, _below)
        high = _tightened("position_max_deg", self.position_max_deg, own.position_max_rad, math.degrees, _above)
        for axis, (lowest, start, highest) in enumerate(zip(low, robot.initial_position_rad, high, strict=True)):
            if math.degrees(highest - lowest) < LEAST:
                raise ConfigurationError(
                    f"limits of {JOINT_NAMES[axis]}: a range of {math.degrees(highest - lowest):g} degrees; "
                    f"at least {LEAST:g} are needed"
                )
            if not lowest <= start <= highest:
                raise ConfigurationError(
                    f"limits of {JOINT_NAMES[axis]}: {robot.name} begins at {math.degrees(start):g} degrees, "
                    f"which is outside {math.degrees(lowest):g} ... {math.degrees(highest):g}"
                )
        velocity = _tightened("velocity_deg_s", self.velocity_deg_s, own.velocity_rad_s, math.degrees, _above)
        torque = _tightened("torque_nm", self.torque_nm, own.torque_nm, _same, _above)
        return replace(
            robot,
            limits=replace(own, position_min_rad=low, position_max_rad=high, velocity_rad_s=velocity, torque_nm=torque),
        )


def _tightened(
    key: str,
    asked: list[float] | None,
    own: Seven,
    shown: Callable[[float], float],
    refused: Callable[[str, float, float], str],
) -> Seven:
    """Return ``asked`` in the robot's unit; ``shown`` turns that into the key's, ``refused`` says what is valid."""
    if asked is None:
        return own
    taken: list[float] = []
    for axis, (value, limit) in enumerate(zip(asked, own, strict=True)):
        problem = refused(key, value, round(shown(limit), 6))
        if problem:
            raise OutOfRange(f"{key} of {JOINT_NAMES[axis]}", value, problem)
        taken.append(limit if value == round(shown(limit), 6) else value / shown(1.0))
    return tuple(taken)  # type: ignore[return-value]  # seven, as the schema asks


def _below(_key: str, value: float, limit: float) -> str:
    return "" if value >= limit else f">= {limit:g}, which is the robot's own; a station tightens limits only"


def _above(key: str, value: float, limit: float) -> str:
    if value <= limit and (value >= LEAST or key.startswith("position")):
        return ""
    least = "" if key.startswith("position") else f">= {LEAST:g} and "
    return f"{least}<= {limit:g}, which is the robot's own; a station tightens limits only"


def _same(value: float) -> float:
    return value
