"""Station files: what to run, checked before anything starts."""

from hil.config.station import FriConfig, ReactionConfig, RobotConfig, ServoConfig, Station, load_station

__all__ = ["FriConfig", "ReactionConfig", "RobotConfig", "ServoConfig", "Station", "load_station"]
