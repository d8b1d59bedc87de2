"""A push: the flange is dragged with the mouse, and the arm feels a spring between the flange and the pointer."""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from hil.values.pose import Pose
from hil.values.robot import Three
from tools.view.browser.arm_drawing import ArmDrawing
from tools.view.browser.renderer import BrowserRenderer
from tools.view.operator import Operator

STIFFNESS_N_M: Final = 300.0
MOST_N: Final = 120.0
_PUSH_S: Final = 0.4
"""How long one message pushes; the next one replaces it. Who falls silent has let go."""
_LEAST_S: Final = 0.001


def push_by_dragging(renderer: BrowserRenderer, operators: Mapping[int, Operator]) -> None:
    """Let operators, by the number of their browser, push the arms that are drawn."""
    for name, arm in renderer.arms.items():
        arm.flange.on_drag("left")(partial(_dragged, operators, name, arm))


def _dragged(operators: Mapping[int, Operator], name: str, arm: ArmDrawing, event: Any) -> None:
    operator = operators.get(event.client_id)
    if operator is None:
        return
    over = event.phase == "end"
    force = (0.0, 0.0, 0.0) if over else push_force(arm.base_in_world, event)
    operator.press(name, lambda pad: pad.push(force, duration_s=_LEAST_S if over else _PUSH_S))


def push_force(base_in_world: Pose, event: Any) -> Three:
    """Return the force in N, axes of the robot base, for a pointer in world coordinates (m)."""
    way = [there - here for here, there in zip(event.start_position, event.end_position, strict=True)]
    length = math.hypot(*way)
    strength = min(STIFFNESS_N_M * length, MOST_N) / length if length > 0.0 else 0.0
    x, y, z = (strength * part for part in way)
    turn = base_in_world.inverse()._replace(x_m=0.0, y_m=0.0, z_m=0.0)
    return (turn @ Pose.from_abc_rad((x, y, z), 0.0, 0.0, 0.0)).position_m
