"""What a state packet says of controller, arm and motions."""

from hil.core.control.stage import ControlStage
from hil.core.motion.executive import MotionExecutive
from hil.core.motion.queue import Entry
from hil.values.arm import ArmState, Contact
from hil.values.motion import MotionPhase
from hil.values.operator import OperatorView
from hil.values.pose import Pose
from hil.values.servo import MotionState, Snapshot


def snapshot(
    *,
    arm: ArmState,
    control: ControlStage,
    executive: MotionExecutive,
    operator: OperatorView,
    flange_in_base: Pose,
    flange_speed_mm_s: float,
    contacts: tuple[Contact, ...],
    commander: str,
    cycle: int,
    now_ns: int,
) -> Snapshot:
    """Return the snapshot of a cycle whose nominal time is ``now_ns``."""
    force, force_variance = control.flange_wrench_and_variance(arm, now_ns=now_ns)
    return Snapshot(
        now_ns,
        cycle,
        operator,
        arm.position_rad,
        executive.set_point.position_rad,
        arm.torque_nm,
        arm.external_torque_nm,
        flange_in_base,
        executive.control.kind,
        control.external_variance_nm2,
        force,
        force_variance,
        commander,
        tuple(
            [
                _motion_state(entry, phase, executive.override, now_ns)
                for entry, phase in executive.applications.phases(may_begin=not executive.paused)
            ]
        ),
        flange_speed_mm_s,
        contacts,
    )


def _motion_state(entry: Entry, phase: MotionPhase, override: float, now_ns: int) -> MotionState:
    motion, accounting = entry.motion, entry.motion.accounting
    remaining_s = motion.remaining_s(now_ns=now_ns) if entry.begun else 0.0
    if 0.0 < override < 1.0:
        remaining_s /= override
    return MotionState(
        entry.number,
        motion.kind,
        phase,
        motion.interpolator,
        motion.destination or (),
        motion.destination_at_ns,
        remaining_s,
        motion.goals_reached,
        accounting.received,
        accounting.superseded,
        accounting.executed,
        accounting.executed_at_ns,
    )
