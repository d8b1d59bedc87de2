"""The station file (TOML): robots, their backends and their links. Unknown keys are errors."""

import tomllib
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from hil.config.control import ControlConfig
from hil.config.frames import FrameConfig, LoadConfig, PoseConfig, ToolConfig, frame_tree
from hil.config.limits import LimitsConfig
from hil.config.objects import ObjectConfig
from hil.config.ring import parse_ring
from hil.config.signals import GroupConfig, signals
from hil.core.settings import (
    CYCLE_CHOICES_MS,
    IDEAL_REACTION,
    ControllerSettings,
    FriSettings,
    ReactionSettings,
    ServoSettings,
)
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.frames import FrameTree
from hil.values.fri import CLIENT_PORT, OperationMode, OverlayKind, Release
from hil.values.kst import DEFAULT_WATCHDOG_MS, KST_PORT, KstSettings, UnprovenLoad
from hil.values.link import Address
from hil.values.load import NO_LOAD, Load
from hil.values.robot import RobotDescription
from hil.values.servo import SERVO_PORT
from hil.values.signals import Signal, check_message_fits
from hil.values.surroundings import SceneArm, Surroundings
from hil.values.tcp_probe import Behaviour


class Mode(StrEnum):
    """Operation mode."""

    T1 = "T1"
    T2 = "T2"
    AUT = "AUT"


class Overrun(StrEnum):
    """What happens to control cycles that could not begin in time. All are counted."""

    CATCH_UP = "catch-up"
    """They are run at once, one after the other, twenty at most; what is more than that is left out.

    With real drives, or a robot side that paces the cycle, they are left out: nobody is told several at once.
    """
    SKIP = "skip"
    """They are left out; a simulated arm's time stands still for them."""
    FAULT = "fault"
    """The first one ends the run: the arm brakes, the sessions close, exit code 1."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FriConfig(_Model):
    """``[robot.fri]``: one FRI client."""

    client: Annotated[str, Field(description="HOST[:PORT] of the FRI client")] = f"127.0.0.1:{CLIENT_PORT}"
    bind: Annotated[
        str | None,
        Field(description="ADDR[:PORT] to serve from; default: any free port for a client on this machine, else 30200"),
    ] = None
    release: Annotated[Release, Field(description="release of the client's FRI library")] = Release.V1_15
    send_period_ms: Annotated[int, Field(strict=True, description="1..100, a multiple of the control cycle")] = 1
    receive_multiplier: Annotated[int, Field(strict=True, description="the client answers every n-th message")] = 1
    overlay: Annotated[OverlayKind, Field(description="overlay of the robot application")] = OverlayKind.JOINT_POSITION
    control: Annotated[ControlConfig, Field(description="control of the arm under the overlay")] = ControlConfig()
    watchdog_ms: Annotated[
        int | None,
        Field(description="silence that ends a commanded motion; default: 50, or 3 answer periods if longer"),
    ] = None
    quality_rise_ms: Annotated[
        int, Field(strict=True, description="time at a better figure before the connection quality rises one level")
    ] = 500

    transformations: Annotated[
        tuple[str, ...], Field(description="names of the transformations the client is asked for, 5 at most")
    ] = ()

    def settings(self, peer: Address) -> FriSettings:
        """Return the core's settings; raise :class:`ConfigurationError` for a pairing that cannot work."""
        settings = FriSettings(
            peer=peer,
            send_period_ms=self.send_period_ms,
            receive_multiplier=self.receive_multiplier,
            overlay=self.overlay,
            control=self.control.settings(self.overlay),
            watchdog_ms=self.watchdog_ms,
            quality_rise_ms=self.quality_rise_ms,
            transformations=self.transformations,
        )
        settings.check_release(self.release)
        return settings

    @model_validator(mode="after")
    def _pairings(self) -> Self:
        self.settings(Address("127.0.0.1", CLIENT_PORT))
        return self


class ServoConfig(_Model):
    """``[robot.servo]``: applications that start motions and set destinations online."""

    bind: Annotated[str, Field(description="ADDR[:PORT] where applications connect to")] = f"127.0.0.1:{SERVO_PORT}"
    key_file: Annotated[
        Path | None, Field(description="file with the pre-shared key that every packet must be tagged with")
    ] = None


class KstConfig(_Model):
    """``[robot.kst]``: a server for KST programs; it commands the arm through the servo link."""

    bind: Annotated[str, Field(description="ADDR[:PORT] where KST programs connect to")] = f"127.0.0.1:{KST_PORT}"
    strict: Annotated[bool, Field(strict=True, description="do as a published server does, its faults included")] = (
        False
    )
    nagle: Annotated[bool, Field(strict=True, description="leave Nagle's algorithm on, as a published server does")] = (
        False
    )
    watchdog_ms: Annotated[
        int, Field(strict=True, ge=0, le=60_000, description="silence in velocity mode that stops the arm; 0: none")
    ] = DEFAULT_WATCHDOG_MS
    unproven_load: Annotated[
        UnprovenLoad,
        Field(description="impedance with a load that is not the true one: replace (take the true one) or refuse"),
    ] = UnprovenLoad.REPLACE
    second_acknowledgement: Annotated[
        bool, Field(strict=True, description="acknowledge the end of impedance once more, as published servers do")
    ] = True

    def settings(self, description: RobotDescription) -> KstSettings:
        """Return the server's settings for a robot with its station's limits."""
        return KstSettings(
            position_min_rad=description.limits.position_min_rad,
            position_max_rad=description.limits.position_max_rad,
            velocity_max_rad_s=description.limits.velocity_rad_s,
            strict=self.strict,
            nagle=self.nagle or self.strict,
            watchdog_ms=self.watchdog_ms,
            unproven_load=self.unproven_load,
            second_acknowledgement=self.second_acknowledgement,
        )


class Reaction(StrEnum):
    """System reaction time of servo motions, as a profile."""

    CABINET = "cabinet"
    """22 ms for SmartServo, 12 ms for DirectServo, as the manual has them."""
    IDEAL = "ideal"
    """None: a destination reaches the interpolator in the next cycle."""


class ReactionConfig(_Model):
    """``[robot.reaction]``: from the arrival of a destination to the effective motion."""

    profile: Annotated[Reaction, Field(description="cabinet (22 and 12 ms) or ideal (0)")] = Reaction.CABINET
    smart_servo_ms: Annotated[float | None, Field(description="SmartServo, instead of the profile's")] = None
    direct_servo_ms: Annotated[float | None, Field(description="DirectServo, instead of the profile's")] = None

    def settings(self) -> ReactionSettings:
        """Return the core's settings; raise :class:`ConfigurationError`."""
        base = IDEAL_REACTION if self.profile is Reaction.IDEAL else ReactionSettings()
        return ReactionSettings(
            base.smart_servo_ms if self.smart_servo_ms is None else self.smart_servo_ms,
            base.direct_servo_ms if self.direct_servo_ms is None else self.direct_servo_ms,
        )

    @model_validator(mode="after")
    def _bounds(self) -> Self:
        self.settings()
        return self


class RobotConfig(_Model):
    """``[[robot]]``: one robot with its robot side and its links."""

    name: Annotated[str, Field(min_length=1, max_length=40, description="name in logs and status")] = "arm"
    model: Annotated[str, Field(description="robot model")] = "lbr-iiwa-14-r820"
    backend: Annotated[str, Field(description="robot side: mujoco, ideal, or another that hil backends lists")] = (
        "mujoco"
    )
    options: Annotated[
        dict[str, Any], Field(description="options of the backend, which checks them: hil backends NAME lists them")
    ] = {}  # pydantic copies a default
    mode: Annotated[Mode, Field(description="operation mode")] = Mode.AUT
    enabled: Annotated[
        bool,
        Field(strict=True, description="begin T1 and T2 with the enabling switch held and the start key pressed"),
    ] = False
    cycle_ms: Annotated[
        int, Field(strict=True, description=f"control cycle: {', '.join(map(str, CYCLE_CHOICES_MS))} ms")
    ] = 1
    overrun: Annotated[
        Overrun, Field(description="what happens to cycles that could not begin in time: catch-up, skip, fault")
    ] = Overrun.CATCH_UP
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**63, description="seed of the simulated sensor noise")] = 0
    reaction: Annotated[ReactionConfig, Field(description="system reaction time of servo motions")] = ReactionConfig()
    permissive: Annotated[bool, Field(strict=True, description="monitors only report; never with real drives")] = False
    limits: Annotated[LimitsConfig, Field(description="limits tighter than the robot's own")] = LimitsConfig()
    base: Annotated[PoseConfig, Field(description="robot base in the world")] = PoseConfig()
    tool: Annotated[tuple[ToolConfig, ...], Field(max_length=16, description="tools at the flange")] = ()
    load: Annotated[
        LoadConfig | None, Field(description="what truly hangs on a simulated flange; default: the mounted tool")
    ] = None
    torque_noise: Annotated[
        bool, Field(strict=True, description="whether simulated torque sensors have noise and steps")
    ] = True
    frame: Annotated[tuple[FrameConfig, ...], Field(max_length=64, description="reference frames")] = ()
    io: Annotated[
        tuple[GroupConfig, ...], Field(max_length=32, description="groups of inputs and outputs; FRI shows 10 at most")
    ] = ()
    fri: Annotated[FriConfig | None, Field(description="FRI link; leave the section out for none")] = None
    servo: Annotated[ServoConfig | None, Field(description="servo link; leave the section out for none")] = None
    kst: Annotated[KstConfig | None, Field(description="KST server; leave the section out for none")] = None

    def settings(
        self, *, unix_epoch_ns: int, fri_peer: Address | None, servo: ServoSettings | None
    ) -> ControllerSettings:
        """Return the core's settings; raise :class:`ConfigurationError` for a pairing that cannot work."""
        return ControllerSettings(
            operation_mode=OperationMode[self.mode.value],
            cycle_ms=self.cycle_ms,
            unix_epoch_ns=unix_epoch_ns,
            fri=None if self.fri is None or fri_peer is None else self.fri.settings(fri_peer),
            servo=servo,
            reaction=self.reaction.settings(),
            safety=self.limits.settings(permissive=self.permissive),
            enabled=self.enabled,
            frames=self.frames(),
            load=self.told_load(),
            signals=self.signals(),
        )

    def told_load(self) -> Load:
        """Return the load of the tool that is mounted, in the flange; raise :class:`ConfigurationError` for two."""
        mounted = [tool for tool in self.tool if tool.mounted]
        if len(mounted) > 1:
            names = " and ".join(repr(tool.name) for tool in mounted)
            raise ConfigurationError(f"the tools {names} are both mounted; one flange carries one tool")
        return self.frames().load_of(mounted[0].name) if mounted else NO_LOAD

    def true_load(self) -> Load:
        """Return what hangs on the flange of a simulated arm."""
        return self.told_load() if self.load is None else self.load.load()

    def scene_arm(self) -> SceneArm:
        """Return the robot as the others of its station see it."""
        tree, mounted = self.frames(), next((tool for tool in self.tool if tool.mounted), None)
        names = () if mounted is None else (mounted.name, *(frame.name for frame in mounted.frame))
        return SceneArm(
            name=self.name,
            model=self.model,
            backend=self.backend,
            options=self.options,
            base_in_world=self.base.pose(),
            load=self.true_load(),
            cycle_ns=self.cycle_ms * 1_000_000,
            touches_m=tuple(tree.in_flange(name).position_m for name in names),
        )

    def signals(self) -> tuple[Signal, ...]:
        """Return the robot's inputs and outputs; raise :class:`ConfigurationError` where they cannot be."""
        return signals(self.io)

    def frames(self) -> FrameTree:
        """Return the robot's frames; raise :class:`ConfigurationError` where they are no tree."""
        return frame_tree(base=self.base, tools=self.tool, frames=self.frame)

    @model_validator(mode="after")
    def _pairings(self) -> Self:
        settings = self.settings(unix_epoch_ns=0, fri_peer=Address("127.0.0.1", CLIENT_PORT), servo=None)
        if self.fri is not None:
            check_message_fits(self.fri.release, settings.signals, self.fri.transformations)
        if self.kst is not None and self.servo is None:
            raise ConfigurationError(
                f"{self.name}: a KST server commands the arm through the servo link, and needs one"
            )
        return self


class TcpProbeConfig(_Model):
    """``[tcp_probe]``: the responder that ``hil doctor tcp`` measures against."""

    bind: Annotated[str, Field(description="ADDR:PORT it listens at")]
    behaviour: Annotated[
        Behaviour, Field(description="good, or a bad peer: nagle, delayed-ack, delayed-ack-200ms (emulated)")
    ] = Behaviour.GOOD


class Station(_Model):
    """A station: one or more robots, and what the process as a whole does."""

    realtime: Annotated[bool, Field(strict=True, description="ask for SCHED_FIFO, locked memory and a CPU")] = False
    capture: Annotated[Path | None, Field(description="pcapng file to record all packets to")] = None
    capture_ring: Annotated[
        str | None,
        Field(description="keep only the newest files of the capture: FILESxSIZE, such as 10x100MB; default: one file"),
    ] = None
    pad: Annotated[
        str | None,
        Field(description="socket of the operator's pad, or off; default: one in a folder only its owner may open"),
    ] = None
    tcp_probe: Annotated[
        TcpProbeConfig | None, Field(description="responder for hil doctor tcp; leave the section out for none")
    ] = None
    object: Annotated[tuple[ObjectConfig, ...], Field(max_length=64, description="what simulated arms can touch")] = ()
    robot: Annotated[list[RobotConfig], Field(min_length=1, max_length=16, description="the robots")]

    def surroundings(self) -> Surroundings:
        """Return what stands around the robots, for all of them; a new one each time."""
        return Surroundings(
            tuple(one.scene_object() for one in self.object), tuple(robot.scene_arm() for robot in self.robot)
        )

    @field_validator("capture_ring")
    @classmethod
    def _ring(cls, text: str | None) -> str | None:
        if text is not None:
            parse_ring(text)
        return text

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [robot.name for robot in self.robot]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ConfigurationError(f"two robots have the name {twice[0]!r}; each needs its own")
        objects = [one.name for one in self.object]
        if twice := sorted({name for name in objects if objects.count(name) > 1}):
            raise ConfigurationError(f"two objects have the name {twice[0]!r}; each needs its own")
        _refuse_shared("FRI client", [robot.fri.client for robot in self.robot if robot.fri is not None])
        binds = [robot.servo.bind for robot in self.robot if robot.servo is not None]
        _refuse_shared("servo address", [bind for bind in binds if not bind.endswith(":0")])
        binds = [robot.kst.bind for robot in self.robot if robot.kst is not None]
        _refuse_shared("KST address", [bind for bind in binds if not bind.endswith(":0")])
        if self.capture is not None and "\0" in str(self.capture):
            raise ConfigurationError(f"the capture file {str(self.capture)!r} has a NUL in its name")
        return self


def _refuse_shared(what: str, values: list[str]) -> None:
    shared = sorted({value for value in values if values.count(value) > 1})
    if shared:
        raise ConfigurationError(f"two robots have the {what} {shared[0]!r}; each needs its own")


def load_station(path: Path) -> Station:
    """Return the station in ``path``; raise :class:`ConfigurationError` in one sentence that names file and key."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot read station file {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"cannot read station file {path}: it is no UTF-8 text") from error
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"station file {path} is no TOML: {error}") from error
    return parse_station(content, where=str(path))


def robot_keys(path: Path, name: str | None, *, where: str) -> dict[str, Any]:
    """Return what the station in ``path`` says of its robot ``name``; None: of the only one it has.

    Raises :class:`ConfigurationError`, which begins with ``where``, if it has several and none is named, and
    :class:`UnknownName`.
    """
    robots: list[dict[str, Any]] = load_station(path).model_dump(exclude_unset=True)["robot"]
    names = [robot.get("name", "arm") for robot in robots]
    if name is None and len(robots) > 1:
        raise ConfigurationError(f"{where}: {path} has the robots {', '.join(names)}; choose one with robot_name=")
    if name is None:
        return robots[0]
    if name not in names:
        raise UnknownName("robot", name, names)
    return robots[names.index(name)]


def parse_station(content: dict[str, Any], *, where: str) -> Station:
    """Return the station that ``content`` describes; raise :class:`ConfigurationError` that begins with ``where``."""
    try:
        return Station.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(f"{where}: {first_problems(error)}") from None


def parse_robot(content: dict[str, Any], *, where: str) -> RobotConfig:
    """Return the robot that ``content`` describes; errors as those of :func:`parse_station`."""
    try:
        return RobotConfig.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(f"{where}: {first_problems(error)}") from None


def first_problems(error: ValidationError, most: int = 3, *, listed: str = "hil config schema lists all") -> str:
    """Return in words what pydantic found, with the place of each in the file; ``listed``: where the keys are."""
    found = error.errors(include_url=False)
    # A list of which one is wrong is not too short for that.
    problems = [one for one in found if one["type"] != "too_short" or not _is_about_parts_too(one, found)]
    told = [f"{_place(problem['loc'])}{_message(problem, listed)}" for problem in problems[:most]]
    if len(problems) > most:
        told.append(f"and {len(problems) - most} more")
    return "; ".join(told)


def _place(location: tuple[int | str, ...]) -> str:
    place = "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    return f"{place}: " if place else ""


def _is_about_parts_too(problem: Any, found: Sequence[Any]) -> bool:
    place = problem["loc"]
    return any(other["loc"] != place and other["loc"][: len(place)] == place for other in found)


def _message(problem: Any, listed: str) -> str:  # pydantic's error dictionary has no public type
    message = str(problem["msg"]).removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        return f"there is no such key ({listed})"
    if problem["type"] in {"value_error", "missing"}:
        return message
    return f"{message}, got {problem['input']!r}"
