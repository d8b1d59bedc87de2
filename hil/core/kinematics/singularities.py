"""The singularities of an S-R-S arm by name (robot facts 8).

With A3 held at E1 the determinant of the 6x6 Jacobian is d3 d5 sin(A4) x sin(A6) but for its sign, where x is the wrist
centre's coordinate in the frame turned by A1: three factors, and at each a bit of Status flips. So every row here is
singular with E1 held. Moving A3 as well rescues all but those marked ``whole_arm``.
"""

from enum import Enum


class Singularity(Enum):
    """One row of robot facts 8."""

    ELBOW_STRETCHED = ("A4 = 0", True)
    WRIST_CENTRE_OVERHEAD = ("wrist centre at x = 0 in the frame turned by A1", False)
    WRIST_STRETCHED = ("A6 = 0", False)
    SHOULDER_WITH_ELBOW_SIDEWAYS = ("A2 = 0 and A3 = +-90 deg", True)
    WRIST_WITH_ELBOW_SIDEWAYS = ("A6 = 0 and A5 = +-90 deg", True)
    SHOULDER_AND_WRIST = ("A2 = 0 and A6 = 0", True)
    ELBOW_RIGHT_ANGLE_AND_WRIST = ("A4 = +-90 deg and A6 = 0", False)

    def __init__(self, condition: str, whole_arm: bool) -> None:
        self.condition = condition
        self.whole_arm = whole_arm
        """The 6x7 Jacobian loses rank: in some direction the flange cannot move, whatever the seven axes do."""

    def __str__(self) -> str:
        return self.condition
