"""What an application may ask of a robot: its frames, where its flange is at axis positions, whether a load is true."""

import math

from hil.core.kinematics.srs import SrsKinematics
from hil.core.servo.answer import Answer
from hil.core.servo.control_choice import ControlChoice
from hil.core.servo.reports import ReportLog
from hil.values.arm import ArmState, seven
from hil.values.frames import FrameTree
from hil.values.motion import Fault
from hil.values.robot import JOINT_COUNT
from hil.values.servo import (
    DescribeFrame,
    FlangeLocated,
    FrameDescribed,
    LoadValidated,
    LocateFlange,
    RequestError,
    ValidateLoad,
)

Question = DescribeFrame | LocateFlange | ValidateLoad


class Questions:
    """Answers with a report, before the one that says that the request is done."""

    def __init__(self, *, frames: FrameTree, kinematics: SrsKinematics, control: ControlChoice) -> None:
        self._frames = list(frames.values())
        self._kinematics = kinematics
        self._control = control

    def answer(self, request: Question, reports: ReportLog, arm: ArmState) -> Answer:
        """Add the answer to ``reports``; return what became of the request."""
        if isinstance(request, DescribeFrame):
            return self._describe(request, reports)
        if isinstance(request, LocateFlange):
            return self._locate(request, reports)
        reason = self._control.validate(request.frame, request.tool, arm)
        if isinstance(reason, Answer):
            return reason
        reports.add(lambda number: LoadValidated(number, request.number, reason))
        return Answer()

    def _describe(self, request: DescribeFrame, reports: ReportLog) -> Answer:
        frames = self._frames
        if not 0 <= request.place < len(frames):
            return _refused(f"there is no frame {request.place}; there are {len(frames)}, the first is 0")
        frame = frames[request.place]
        reports.add(lambda number: FrameDescribed(number, request.number, len(frames), frame))
        return Answer()

    def _locate(self, request: LocateFlange, reports: ReportLog) -> Answer:
        position = request.position
        if len(position) != JOINT_COUNT or not all(map(math.isfinite, position)):
            return _refused(f"{position} are no {JOINT_COUNT} axis positions; finite numbers in rad are needed")
        flange_in_base = self._kinematics.forward(seven(position))
        reports.add(lambda number: FlangeLocated(number, request.number, flange_in_base))
        return Answer()


def _refused(reason: str) -> Answer:
    return Answer(RequestError.ILLEGAL_ARGUMENT, Fault(reason))
