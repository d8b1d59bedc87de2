"""What became of the destinations an application set, as far as it knows at its last update."""

from typing import NamedTuple

from hil.values.servo import MotionState


class SetPointAccounting(NamedTuple):
    """Destinations of one motion: counted here as they were set, and by the controller as it had them."""

    sent: int
    """Destinations the application set, the one the motion was made with included."""
    received: int
    """Destinations the controller took. What is missing is on its way, was refused, or was replaced on the way."""
    superseded: int
    """Of those received: replaced by a newer one before the interpolator had them."""
    executed: int
    """Of those received: the interpolator went for them."""
    waiting: int
    """Of those received: the interpolator does not have them yet (reaction time, pause, motion not begun)."""
    age_ms: float | None
    """Of the last one: from its arrival to the cycle in which the interpolator had it; None while one waits."""

    def __str__(self) -> str:
        age = "" if self.age_ms is None else f"; the last one {self.age_ms:.1f} ms after it arrived"
        return (
            f"destinations sent {self.sent}, received {self.received}, superseded {self.superseded}, "
            f"waiting {self.waiting}, executed {self.executed}{age}"
        )


def accounting_of(motion: MotionState, *, sent: int) -> SetPointAccounting:
    """Return the accounting of a motion as the last update showed it."""
    waiting = motion.received - motion.superseded - motion.executed
    age_ms = None
    if motion.executed and not waiting:
        age_ms = (motion.executed_at_ns - motion.destination_at_ns) / 1e6
    return SetPointAccounting(sent, motion.received, motion.superseded, motion.executed, waiting, age_ms)
