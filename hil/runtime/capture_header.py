"""What a capture of ours says of its run in the comment of its section: all that a fresh controller needs."""

import platform
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Annotated, Final, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from hil.arithmetic import arithmetic_fingerprint
from hil.config.station import RobotConfig, Station
from hil.core.controller import FRI_LINK
from hil.core.servo.link import SERVO_LINK
from hil.values.link import Address
from hil.version import SOFTWARE
from transport.capture.endpoints import pack_endpoint

_LIBRARIES: Final = ("mujoco", "numpy", "pin", "ruckig")
_FORMAT: Final = 1
ARITHMETIC: Final = "arithmetic"
"""Key of the fingerprint in ``machine``."""
_END_OF_TIME_NS: Final = 1 << 63
_LONGEST_HEXADECIMAL: Final = 1 << 17
_HEXADECIMAL: Final = r"^([0-9a-f]{2})*$"


def _endpoint(endpoint: tuple[str, int]) -> tuple[str, int]:
    pack_endpoint(endpoint)
    return endpoint


_Endpoint = Annotated[tuple[str, int], AfterValidator(_endpoint)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class FirstMessage(_Model):
    """The first datagram of a robot side that is a network peer: it says where the arm is when the run begins."""

    sender: _Endpoint
    datagram: Annotated[str, Field(pattern=_HEXADECIMAL, max_length=_LONGEST_HEXADECIMAL, description="hexadecimal")]


class RobotStart(_Model):
    """One robot of the run, in the order of the station."""

    name: str
    unix_epoch_ns: Annotated[int, Field(ge=0, lt=_END_OF_TIME_NS, description="Unix time of core time 0")]
    fri_peer: Annotated[_Endpoint | None, Field(description="where the FRI client is")] = None
    bound: Annotated[dict[str, _Endpoint], Field(description="by link: where it is served from")] = {}
    token_secret: Annotated[
        str, Field(pattern=_HEXADECIMAL, description="what session tokens are made with, hexadecimal")
    ] = ""
    robot_side: Annotated[
        FirstMessage | None, Field(description="what a robot side that is a network peer sent before the first cycle")
    ] = None
    cycles_before: Annotated[int, Field(ge=0, description="control cycles that had run when the recording began")] = 0

    def address(self, link: str) -> Address | None:
        """Return where a link is served from."""
        return Address(*self.bound[link]) if link in self.bound else None

    @property
    def fri_client(self) -> Address | None:
        """Where the FRI client is."""
        return None if self.fri_peer is None else Address(*self.fri_peer)


class CaptureHeader(_Model):
    """The comment, as JSON. Captures before format 1 have a station and no robots."""

    software: str
    format: int = 0
    station: Station
    robots: tuple[RobotStart, ...] = ()
    machine: dict[str, str] = {}

    @model_validator(mode="after")
    def _robots_fit(self) -> Self:
        if self.robots and [robot.name for robot in self.robots] != [robot.name for robot in self.station.robot]:
            raise ValueError("the robots that began are not those of the station")
        for start, config in zip(self.robots, self.station.robot, strict=False):
            for link, there in ((FRI_LINK, config.fri), (SERVO_LINK, config.servo)):
                if there is not None and link not in start.bound:
                    raise ValueError(f"{start.name}: nothing says where its {link} link was served from")
        return self

    @property
    def complete(self) -> bool:
        """Whether the recording began with the run."""
        return bool(self.robots) and not any(robot.cycles_before for robot in self.robots)

    @classmethod
    def of_run(cls, station: Station, robots: tuple[RobotStart, ...]) -> Self:
        """Return the header of a run that records now."""
        return cls(
            software=SOFTWARE,
            format=_FORMAT,
            station=station.model_copy(update={"capture": None}),
            robots=robots,
            machine=machine(),
        )

    def with_key(self, key_file: Path) -> Self:
        """Return it with another file for the key of every servo link that has one."""
        robots = [
            robot
            if robot.servo is None or robot.servo.key_file is None
            else robot.model_copy(update={"servo": robot.servo.model_copy(update={"key_file": key_file})})
            for robot in self.station.robot
        ]
        return self.model_copy(update={"station": self.station.model_copy(update={"robot": robots})})

    def to_comment(self) -> str:
        """Return the text for the section's comment."""
        return self.model_dump_json()

    def config(self, robot: int) -> RobotConfig:
        """Return the configuration of a robot."""
        return self.station.robot[robot]


@cache
def machine() -> dict[str, str]:
    """Return what a run is computed with; the first call takes longer than a cycle."""
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        **{name: metadata.version(name) for name in _LIBRARIES},
        ARITHMETIC: arithmetic_fingerprint(),
    }


def read_header(comment: str | None) -> CaptureHeader | None:
    """Return what a comment says; None where it is none of ours."""
    if not comment or not comment.lstrip().startswith("{"):
        return None
    try:
        return CaptureHeader.model_validate_json(comment)
    except ValidationError:
        return None
