"""Why a Cabinet takes no commands, in words that say what is to be done there."""

from typing import Final

from backends.cabinet.reading import Said
from hil.values.fri import ClientCommandMode, OverlayKind, SafetyState, SessionState
from hil.values.robot import JOINT_NAMES, Seven

COMMAND_MODES: Final = {
    OverlayKind.JOINT_POSITION: ClientCommandMode.JOINT_POSITION,
    OverlayKind.TORQUE: ClientCommandMode.TORQUE,
    OverlayKind.WRENCH: ClientCommandMode.WRENCH,
}
SHADOW: Final = "shadow: this controller only watches the Cabinet"
_TAKES: Final = {
    ClientCommandMode.NONE: "nothing from a client",
    ClientCommandMode.JOINT_POSITION: "joint positions",
    ClientCommandMode.WRENCH: "wrenches",
    ClientCommandMode.TORQUE: "torques",
    ClientCommandMode.CARTESIAN_POSE: "Cartesian poses, which this link does not speak",
}


def why_left(said: Said) -> str:
    """Return where a Cabinet is that left commanding, and what it says of the reason."""
    stop = "" if said.safety_state is SafetyState.NORMAL_OPERATION else f", {said.safety_state.name}"
    return f"it is in {said.state.name}, quality {said.quality.name}{stop}"


def before_commanding(said: Said) -> str:
    """Return what the Cabinet's session lacks for COMMANDING_WAIT."""
    match said.state:
        case SessionState.IDLE:
            return "the Cabinet has closed the FRI session: start the robot application there"
        case SessionState.MONITORING_WAIT:
            return (
                f"the Cabinet is in MONITORING_WAIT: it rates the connection {said.quality.name}, GOOD is needed; "
                f"it rises while this controller answers in time"
            )
        case _ if said.safety_state is not SafetyState.NORMAL_OPERATION:
            return f"the Cabinet is in MONITORING_READY and stopped ({said.safety_state.name}): clear that there first"
        case _:
            return "the Cabinet is in MONITORING_READY: start the motion with an overlay in the robot application there"


def other_command_mode(said: Said, overlay: OverlayKind) -> str:
    """Return that the motion at the Cabinet takes something else than this station says; empty where it fits."""
    if said.command_mode is COMMAND_MODES[overlay] and said.interpolator_rad is not None:
        return ""
    return f"the motion at the Cabinet takes {_TAKES[said.command_mode]}, this station says overlay = {overlay}"


def waits_for_mirror(set_point_rad: Seven | None, interpolator_rad: Seven, tolerance_rad: float) -> str:
    """Return what the Cabinet waits for in COMMANDING_WAIT."""
    if set_point_rad is not None:
        off = [here - there for here, there in zip(set_point_rad, interpolator_rad, strict=True)]
        axis = max(range(len(off)), key=lambda place: abs(off[place]))
        if abs(off[axis]) > tolerance_rad:
            return (
                f"the Cabinet is in COMMANDING_WAIT: the set point of {JOINT_NAMES[axis]} is {off[axis]:+.5f} rad off "
                f"its interpolator, {tolerance_rad:g} rad are allowed"
            )
    return "the Cabinet is in COMMANDING_WAIT, until it has seen that the set point mirrors its interpolator"
