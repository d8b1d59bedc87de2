"""What of a robot is shown in the page."""

from dataclasses import dataclass


@dataclass(slots=True)
class Shown:
    """Chosen in the page, for all who look at it."""

    set_point: bool = True
    trail: bool = True
    frames: bool = False
    forces: bool = True
