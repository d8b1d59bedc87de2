"""Station files: what to run, checked before anything starts."""

from hil.config.station import FriConfig, RobotConfig, Station, load_station

__all__ = ["FriConfig", "RobotConfig", "Station", "load_station"]
