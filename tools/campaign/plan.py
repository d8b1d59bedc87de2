"""The campaign file (TOML): what is combined with what. Unknown keys are errors."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from hil.config.frames import LoadConfig
from hil.config.station import first_problems, parse_robot, robot_keys
from hil.values.errors import ConfigurationError, HilError
from tools.campaign.program import Programs
from tools.campaign.robot_kinds import RobotKinds
from tools.campaign.scenario import Require, Scenario
from transport.impairment import parse_fault

MOST_SCENARIOS: Final = 1_000_000
_NAME: Final = re.compile(r"[\w.+-][\w.+, -]{0,39}")
_DEFAULT_ROBOT: Final[Mapping[str, Any]] = {"fri": {}, "servo": {}}

_NAMES: Final = "1 to 40 letters, digits, spaces, commas and . + - _"


def _named(name: str) -> str:
    if _NAME.fullmatch(name) is None:
        raise ConfigurationError(f"{name!r} is no name: {_NAMES}, no space first")
    return name


Name = Annotated[str, AfterValidator(_named), Field(description=_NAMES)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Axis(_Model):
    """One choice of one axis."""

    name: Name
    robot: Annotated[dict[str, Any], Field(description="keys of a robot in a station file, laid over the others")] = {}

    def keys(self) -> dict[str, Any]:
        """Return what it lays over the robot."""
        return self.robot


_Only = Annotated[tuple[str, ...] | None, Field(min_length=1, description="only with these; default: all")]


class ApplicationConfig(_Axis):
    """``[[application]]``: a program of yours, or a capture whose client speaks again."""

    run: Annotated[str | None, Field(description="module, or file.py, that is run as a program")] = None
    arguments: Annotated[tuple[str, ...], Field(description="its command line")] = ()
    capture: Annotated[Path | None, Field(description="capture: its FRI client and its servo application speak")] = None
    impairments: _Only = None
    gains: _Only = None
    loads: _Only = None

    @model_validator(mode="after")
    def _one_of(self) -> Self:
        if (self.run is None) == (self.capture is None):
            raise ConfigurationError(f"application {self.name!r} needs run or capture, one of them")
        if self.capture is not None and self.arguments:
            raise ConfigurationError(f"application {self.name!r}: a capture takes no arguments")
        return self


class ImpairmentConfig(_Axis):
    """``[[impairment]]``: a bad network, as ``hil impair`` takes it."""

    faults: Annotated[tuple[str, ...], Field(description="such as loss=2% or jitter=1ms; none: a perfect network")] = ()

    @field_validator("faults")
    @classmethod
    def _readable(cls, faults: tuple[str, ...]) -> tuple[str, ...]:
        for fault in faults:
            try:
                parse_fault(fault)
            except HilError as error:
                raise ConfigurationError(str(error)) from None
        return faults


class GainsConfig(_Axis):
    """``[[gains]]``: control under the FRI overlay, or options of the program."""

    control: Annotated[dict[str, Any] | None, Field(description="keys of [robot.fri.control]")] = None
    arguments: Annotated[tuple[str, ...], Field(description="put behind the arguments of a program")] = ()

    def keys(self) -> dict[str, Any]:
        """Return what it lays over the robot."""
        return self.robot if self.control is None else laid_over(self.robot, {"fri": {"control": self.control}})


class CampaignLoad(_Axis, LoadConfig):
    """``[[load]]``: what hangs on the flange."""

    told: Annotated[bool, Field(strict=True, description="whether the controller knows of it, as a mounted tool")] = (
        True
    )

    def keys(self) -> dict[str, Any]:
        """Return what it lays over the robot."""
        load = self.model_dump(include=set(LoadConfig.model_fields), exclude_unset=True)
        if not load:
            return self.robot
        hangs: dict[str, Any] = {"load": load}
        if self.told:
            hangs["tool"] = [{"name": "campaign load", "mounted": True, **load}]
        return laid_over(self.robot, hangs)


class Campaign(_Model):
    """A campaign file."""

    seconds: Annotated[float, Field(gt=0.0, le=86_400.0, description="virtual time a scenario may take")] = 30.0
    patience_s: Annotated[
        float, Field(gt=0.0, le=86_400.0, description="real time a scenario may take; then its worker is ended")
    ] = 120.0
    retries: Annotated[int, Field(ge=0, le=10, description="further tries where a worker died")] = 2
    seeds: Annotated[
        int | tuple[int, ...], Field(description="how many (1, 2, ...), or which: of the network and the sensors")
    ] = 1
    station: Annotated[Path | None, Field(description="station file whose robot is the base of all scenarios")] = None
    robot_name: Annotated[str | None, Field(description="which of its robots, where it has several")] = None
    robot: Annotated[dict[str, Any], Field(description="keys of a robot in a station file, laid over it")] = {}
    require: Annotated[Require, Field(description="what makes a scenario a failure")] = Require()
    application: Annotated[tuple[ApplicationConfig, ...], Field(min_length=1)]
    impairment: Annotated[tuple[ImpairmentConfig, ...], Field(min_length=1)] = (ImpairmentConfig(name="perfect"),)
    gains: Annotated[tuple[GainsConfig, ...], Field(min_length=1)] = (GainsConfig(name="default"),)
    load: Annotated[tuple[CampaignLoad, ...], Field(min_length=1)] = (CampaignLoad(name="none"),)

    @field_validator("seeds")
    @classmethod
    def _some_seeds(cls, seeds: int | tuple[int, ...]) -> int | tuple[int, ...]:
        wrong = [seed for seed in (seeds if isinstance(seeds, tuple) else ()) if not 0 <= seed < 2**63]
        if wrong:
            raise ConfigurationError(f"seed {wrong[0]}; 0 to 2^63 - 1 are valid")
        if seeds == () or (isinstance(seeds, int) and not 1 <= seeds <= MOST_SCENARIOS):
            raise ConfigurationError(f"how many seeds (1 to {MOST_SCENARIOS}), or a list of some, not {seeds!r}")
        if isinstance(seeds, tuple) and len(set(seeds)) < len(seeds):
            raise ConfigurationError("a seed is listed twice: the two scenarios would be the same")
        return seeds

    @model_validator(mode="after")
    def _a_station_for_its_robot(self) -> Self:
        if self.robot_name is not None and self.station is None:
            raise ConfigurationError("robot_name is one of a station's robots: station names its file")
        return self

    @model_validator(mode="after")
    def _names(self) -> Self:
        axes: dict[str, Sequence[_Axis]] = {
            "application": self.application,
            "impairments": self.impairment,
            "gains": self.gains,
            "loads": self.load,
        }
        for kind, axis in axes.items():
            names = [one.name for one in axis]
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise ConfigurationError(f"{kind}: the name {twice[0]!r} is given twice")
            for application in self.application:
                for name in getattr(application, kind, None) or () if kind != "application" else ():
                    if name not in names:
                        raise ConfigurationError(
                            f"application {application.name!r}: {kind} has {name!r}; valid: {', '.join(names)}"
                        )
        return self

    @property
    def numbers(self) -> Sequence[int]:
        """The seeds."""
        return range(1, self.seeds + 1) if isinstance(self.seeds, int) else self.seeds


@dataclass(frozen=True, slots=True)
class Plan:
    """The scenarios of a campaign file, in order."""

    campaign: Campaign
    scenarios: tuple[Scenario, ...]


def load_plan(path: Path) -> Plan:
    """Return what the campaign file ``path`` asks for; raise :class:`ConfigurationError` before anything runs."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"cannot read campaign file {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"campaign file {path} is no TOML: {error}") from error
    try:
        campaign = Campaign.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(f"{path}: {first_problems(error, listed='docs/campaigns.md lists all')}") from None
    shared = _Shared(path, _base(campaign, path), Programs(path.parent), RobotKinds())
    count = len(campaign.numbers) * sum(1 for _ in _combinations(campaign))
    if count > MOST_SCENARIOS:
        raise ConfigurationError(f"{path}: {count} scenarios; {MOST_SCENARIOS} at most")
    scenarios = [
        scenario for combination in _combinations(campaign) for scenario in _seeded(campaign, combination, shared)
    ]
    if not scenarios:
        raise ConfigurationError(f"{path}: nothing goes with anything: no application has all it is combined with")
    return Plan(campaign, tuple(scenarios))


_Combination = tuple[ApplicationConfig, ImpairmentConfig, GainsConfig, CampaignLoad]


def _combinations(campaign: Campaign) -> Iterator[_Combination]:
    for application, impairment, gains, load in product(
        campaign.application, campaign.impairment, campaign.gains, campaign.load
    ):
        only = (
            (application.impairments, impairment.name),
            (application.gains, gains.name),
            (application.loads, load.name),
        )
        if all(names is None or name in names for names, name in only):
            yield application, impairment, gains, load


def _base(campaign: Campaign, path: Path) -> dict[str, Any]:
    if campaign.station is None:
        return laid_over(_DEFAULT_ROBOT, campaign.robot)
    return laid_over(robot_keys(path.parent / campaign.station, campaign.robot_name, where=str(path)), campaign.robot)


class _Shared(NamedTuple):
    """What all scenarios of a file have: where it is, the robot below theirs, and what was looked up already."""

    path: Path
    base: Mapping[str, Any]
    programs: Programs
    robots: RobotKinds


def _seeded(campaign: Campaign, combination: _Combination, shared: _Shared) -> Iterator[Scenario]:
    application, impairment, gains, load = combination
    programs = shared.programs
    where = f"{shared.path}: {'/'.join(one.name for one in combination)}"
    robot = dict(shared.base)
    capture: Path | None = None
    if application.capture is not None:
        capture = programs.file(application.capture, where)
        robot = _recorded_robot(capture, robot, campaign, where)
    for axis in combination:
        robot = laid_over(robot, axis.keys())
    robot.pop("kst", None)
    config = parse_robot(robot, where=where)
    try:
        shared.robots.check(config)
    except HilError as error:
        raise ConfigurationError(f"{where}: {error}") from error
    run = None if application.run is None else programs.run(application.run, where)
    arguments = () if run is None else (*application.arguments, *gains.arguments)
    content = programs.digest_of_run(run, arguments) if run is not None else ""
    if capture is not None:
        content = programs.digest(capture)
    for seed in campaign.numbers:
        yield Scenario(
            application=application.name,
            impairment=impairment.name,
            gains=gains.name,
            load=load.name,
            seed=seed,
            run=run,
            arguments=arguments,
            capture=None if capture is None else str(capture),
            faults=impairment.faults,
            robot=robot,
            seconds=campaign.seconds,
            require=campaign.require,
            content=content,
        )


def _recorded_robot(capture: Path, base: Mapping[str, Any], campaign: Campaign, where: str) -> dict[str, Any]:
    """Return the robot of a recording; without a station file, that is the base of its scenarios."""
    from hil.replay.replay import recorded_config

    if campaign.station is not None:
        return dict(base)
    try:
        recorded = recorded_config(capture)
    except HilError as error:
        raise ConfigurationError(f"{where}: {error}") from error
    return laid_over(recorded.model_dump(mode="json", exclude_unset=True), campaign.robot)


def laid_over(before: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``before`` with ``keys`` laid over it, section by section."""
    merged = dict(before)
    for key, value in keys.items():
        old = merged.get(key)
        merged[key] = laid_over(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged
