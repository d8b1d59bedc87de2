"""Whether the robots of a campaign can be, in virtual time; told before anything runs."""

import json

from backends.registry import check_backend, load_plugin
from hil.config.station import RobotConfig
from hil.runtime.assembly import make_servo_codec, robot_description
from hil.values.errors import ConfigurationError


class RobotKinds:
    """Robots differ in thousands of ways, their robot sides and keys in few: each is looked up once."""

    def __init__(self) -> None:
        self._known: set[tuple[str, str, str]] = set()

    def check(self, config: RobotConfig) -> None:
        """Raise :class:`HilError` where a robot cannot be, or not in virtual time."""
        robot_description(config)
        key_file = None if config.servo is None else config.servo.key_file
        options = json.dumps(config.options, sort_keys=True, default=str)
        kind = (config.backend, options, str(key_file))
        if kind in self._known:
            return
        check_backend(config.backend, config.options)
        if load_plugin(config.backend).capabilities().paces_the_cycle:
            raise ConfigurationError(f"backend {config.backend} paces the cycle, so it cannot be in virtual time")
        if config.servo is not None:
            make_servo_codec(config.servo)
        self._known.add(kind)
