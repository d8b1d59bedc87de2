"""The robots of a station file, as they are drawn."""

from pathlib import Path

from hil.config import load_station
from tools.view.drawing import DrawnRobot


def station_robots(station: Path) -> tuple[DrawnRobot, ...]:
    """Return them in the file's order; raise :class:`hil.values.errors.ConfigurationError` as the station file does."""
    return tuple(DrawnRobot(robot.name, robot.model, robot.frames()) for robot in load_station(station).robot)
