"""What a commander asks for, done to the motions: one handler for each kind of request, in a table.

A refusal of the manual's carries its text (chapters 10.2 and 10.3); where the manual has none, a sentence of ours.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

from hil.core.motion.application_motion import ApplicationMotion, MotionBasis
from hil.core.motion.direct_servo import DirectServo
from hil.core.motion.executive import MotionExecutive
from hil.core.motion.point_to_point import PointToPoint
from hil.core.motion.queue import Entry
from hil.core.motion.smart_servo import SmartServo
from hil.core.servo.answer import Answer
from hil.core.servo.control_choice import ControlChoice
from hil.values.arm import ArmState
from hil.values.motion import MAX_MOTIONS, Fault, MotionKind
from hil.values.servo import (
    ChangeControlMode,
    Request,
    RequestError,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
    StopMotion,
    Vector,
)

_MOTIONS: Final[Mapping[MotionKind, type[ApplicationMotion]]] = {
    MotionKind.PTP: PointToPoint,
    MotionKind.SMART_SERVO: SmartServo,
    MotionKind.DIRECT_SERVO: DirectServo,
}


_DONE = Answer()


class Circumstances(NamedTuple):
    """What a request is judged by, beside the motions."""

    arm: ArmState
    now_ns: int
    barred: str
    """Why no motion may start now; empty when one may."""


class RequestHandler:
    """Does what a commander asks; ``failed`` is told when a motion ends with an error, to say that the arm brakes."""

    def __init__(
        self,
        *,
        executive: MotionExecutive,
        basis: MotionBasis,
        control: ControlChoice,
        failed: Callable[[Fault, int], None],
    ) -> None:
        self._executive = executive
        self._control = control
        self._basis = basis
        self._failed = failed
        self._handlers: Mapping[type[Request], Callable[[Any, int, Circumstances], Answer]] = {
            StartMotion: self._start,
            SetDestination: self._set_destination,
            SetRuntimeParameters: self._set_parameters,
            ChangeControlMode: self._change_mode,
            StopMotion: self._stop,
        }

    def handle(self, request: Request, *, arrived_ns: int, circumstances: Circumstances) -> Answer:
        """Do what ``request``, which arrived at ``arrived_ns``, asks for; return what became of it."""
        return self._handlers[type(request)](request, arrived_ns, circumstances)

    def replaced_on_the_way(self, motion: int, destinations: int) -> None:
        """So many destinations, for ``motion`` as far as can be told, were replaced by newer ones before they came."""
        found = self._executive.applications.find(motion) or self._executive.applications.end_of(motion)
        if found is not None and found.motion.account is not None:
            found.motion.account.replaced_on_the_way += destinations

    def ready(self, inbox: deque[tuple[int, Request]]) -> Iterator[tuple[int, Request]]:
        """Take what can be done now out of ``inbox``, in its order.

        A destination of a paused motion that waits for the end of the pause waits (manual 9.1.2), and so does what
        came after it, unless the motion is stopped by then, or told not to wait: a newer destination replaces it.
        """
        while inbox:
            _, request = inbox[0]
            if isinstance(request, SetDestination) and self._waits(request.motion, inbox):
                return
            yield inbox.popleft()

    def _waits(self, number: int, inbox: Iterable[tuple[int, Request]]) -> bool:
        """Whether the first request of ``inbox``, a destination for the motion ``number``, has to wait."""
        entry = self._executive.applications.find(number) if self._executive.paused else None
        return entry is not None and entry.motion.parameters.wait_for_pause and not _released(number, inbox)

    def _start(self, request: StartMotion, _arrived_ns: int, circumstances: Circumstances) -> Answer:
        if circumstances.barred:
            return Answer(RequestError.ILLEGAL_STATE, Fault(circumstances.barred))
        if self._executive.applications.full:
            return Answer(
                RequestError.ILLEGAL_STATE, Fault(f"{MAX_MOTIONS} motions run or wait already, no more are taken")
            )
        control = self._control.choose(request.mode, request.frame, request.tool, circumstances.arm)
        if isinstance(control, Answer):
            return control
        destination = request.destination if request.flange_in_base is None else request.flange_in_base
        motion = _MOTIONS[request.kind](request.parameters, basis=self._basis, destination=destination)
        motion.control = control
        self._executive.applications.add(request.number, motion)
        return _DONE

    def _set_destination(self, request: SetDestination, arrived_ns: int, circumstances: Circumstances) -> Answer:
        entry = self._executive.applications.find(request.motion)
        if entry is None:
            self._account_for_a_late_one(request.motion, arrived_ns)
            return self._gone(request.motion)
        account = entry.motion.account
        if account is None:
            return Answer(RequestError.ILLEGAL_STATE, Fault("a PTP takes no new destination while it runs"))
        account.arrived(arrived_ns)
        position: Vector | Fault | None = request.position
        if request.flange_in_base is not None:
            position = entry.motion.axes_of(request.flange_in_base, near_rad=self._executive.set_point.position_rad)
        fault: Fault | None
        if isinstance(position, Fault):
            fault = position
        else:
            fault = entry.motion.set_destination(
                position, request.velocity, measured_rad=circumstances.arm.position_rad, arrived_ns=arrived_ns
            )
        if fault is None:
            return _DONE
        account.refused += 1
        self._fail(entry, fault, circumstances.now_ns)
        return Answer(RequestError.COMMAND_INVALID, fault)

    def _account_for_a_late_one(self, number: int, arrived_ns: int) -> None:
        ended = self._executive.applications.end_of(number)
        if ended is not None and ended.motion.account is not None:
            ended.motion.account.arrived(arrived_ns)
            ended.motion.account.refused += 1

    def _set_parameters(self, request: SetRuntimeParameters, _arrived_ns: int, _: Circumstances) -> Answer:
        entry = self._executive.applications.find(request.motion)
        if entry is None:
            return self._gone(request.motion)
        fault = entry.motion.set_runtime_parameters(
            minimum_execution_time_s=request.minimum_execution_time_s,
            velocity_planning=request.velocity_planning,
            wait_for_pause=request.wait_for_pause,
        )
        return _DONE if fault is None else Answer(RequestError.ILLEGAL_ARGUMENT, fault)

    def _change_mode(self, request: ChangeControlMode, _arrived_ns: int, _: Circumstances) -> Answer:
        entry = self._executive.applications.find(request.motion)
        if entry is None:
            return self._gone(request.motion)
        control = self._control.change(entry.motion.control, request.mode)
        if isinstance(control, Answer):
            return control
        self._executive.change_control(entry.motion, control)
        return _DONE

    def _stop(self, request: StopMotion, _arrived_ns: int, circumstances: Circumstances) -> Answer:
        entry = self._executive.applications.find(request.motion)
        if entry is None:
            return self._gone(request.motion)
        # At any time, irrespective of the state of application and robot (manual 7.5.4): while it waits, too.
        if entry.begun:
            self._executive.stop_application_motion(now_ns=circumstances.now_ns)
        else:
            self._executive.applications.withdraw(entry.number, now_ns=circumstances.now_ns)
        return _DONE

    def _gone(self, number: int) -> Answer:
        ended = self._executive.applications.end_of(number)
        if ended is None:
            return Answer(RequestError.ILLEGAL_STATE, Fault(f"there is no motion {number}"))
        return Answer(RequestError.COMMAND_INVALID, ended.why)

    def _fail(self, entry: Entry, fault: Fault, now_ns: int) -> None:
        if self._executive.fail_application_motion(fault, now_ns=now_ns, number=entry.number):
            self._failed(fault, now_ns)


def _released(number: int, inbox: Iterable[tuple[int, Request]]) -> bool:
    """Whether something behind the first request ends its wait: a newer destination, any stop, or waiting no more."""
    for _, later in itertools.islice(inbox, 1, None):
        # A stop is done at any time (manual 7.5.4), so nothing that came before it waits.
        if isinstance(later, StopMotion) or (isinstance(later, SetDestination) and later.motion == number):
            return True
        if isinstance(later, SetRuntimeParameters) and later.motion == number and later.wait_for_pause is False:
            return True
    return False
