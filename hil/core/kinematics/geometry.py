"""The lengths of an S-R-S arm, read from its Pinocchio model; a model of another build is refused.

S-R-S: the axes of A1, A2, A3 meet in the shoulder, those of A5, A6, A7 in the wrist, and A4 is the elbow (robot facts
1.1). At q = 0 the arm stands upright: odd axes are the base's z axis, even ones cross it along y.
"""

from typing import Final, NamedTuple

import numpy as np
import pinocchio

from hil.values.errors import ConfigurationError
from hil.values.robot import JOINT_COUNT, JOINT_NAMES

_EXACT_M: Final = 1e-9
_AXIS_SIGN: Final = (1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0)
"""KUKA's positive sense of A1 to A7, along +z or +y (robot facts 1.1)."""


class SrsLengths(NamedTuple):
    """Lengths in metres, with the names of robot facts 1.1."""

    d1_m: float
    """Base to shoulder."""
    d3_m: float
    """Shoulder to elbow."""
    d5_m: float
    """Elbow to wrist."""
    d7_m: float
    """Wrist to flange."""


def srs_lengths(model: "pinocchio.Model", flange_frame: str = "flange") -> SrsLengths:
    """Read the lengths from the axes at q = 0; raise ConfigurationError where the model is no S-R-S arm of KUKA's."""
    if (model.nq, model.nv) != (JOINT_COUNT, JOINT_COUNT):
        raise _refusal(model, f"has {model.nq} coordinates and {model.nv} velocities; valid: 7 revolute joints")
    if not model.existFrame(flange_frame):
        raise _refusal(model, f"has no frame {flange_frame!r}")
    data = model.createData()
    upright = np.zeros(JOINT_COUNT)
    # In base axes at the base's origin a column is (point x axis, axis): the axis as a line, whatever the joint's type.
    lines = pinocchio.computeJointJacobians(model, data, upright)
    heights = [_height_m(model, axis, lines[:, axis]) for axis in range(JOINT_COUNT)]
    pinocchio.framesForwardKinematics(model, data, upright)
    flange = data.oMf[model.getFrameId(flange_frame)].homogeneous
    above = np.eye(4)
    above[2, 3] = flange[2, 3]
    if not np.allclose(flange, above, rtol=0.0, atol=_EXACT_M):
        raise _refusal(model, f"has its flange at {flange.tolist()} at q = 0; valid: upright on the base's z axis")
    shoulder, elbow, wrist = heights[1::2]
    lengths = SrsLengths(shoulder, elbow - shoulder, wrist - elbow, float(flange[2, 3]) - wrist)
    if not (lengths.d3_m > _EXACT_M and lengths.d5_m > _EXACT_M):
        raise _refusal(model, f"has lengths {tuple(lengths)}; valid: d3 and d5 above 0 m")
    return lengths


def _height_m(model: "pinocchio.Model", axis: int, line: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> float:
    """Return the height at which the line of an even axis crosses the z axis; 0 for an odd one, which lies on it."""
    sign = _AXIS_SIGN[axis]
    even = axis % 2 == 1
    height = -sign * float(line[0]) if even else 0.0
    expected = (-sign * height, 0.0, 0.0, 0.0, sign, 0.0) if even else (0.0, 0.0, 0.0, 0.0, 0.0, sign)
    if not np.allclose(line, expected, rtol=0.0, atol=_EXACT_M):
        where = "along y, through the base's z axis" if even else "the base's z axis"
        raise _refusal(
            model,
            f"has {JOINT_NAMES[axis]} with the direction {line[3:].tolist()} and the moment {line[:3].tolist()} at "
            f"q = 0; valid: {where}, in the sense {sign:+g}",
        )
    return height


def _refusal(model: "pinocchio.Model", what: str) -> ConfigurationError:
    return ConfigurationError(f"model {model.name!r} is not an S-R-S arm: it {what}")
