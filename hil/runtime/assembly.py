"""From a robot's configuration to a controller with its backend and codec: the one place that knows all rooms."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

from backends.registry import make_backend
from backends.robots import load_description, load_pinocchio
from hil.config.station import RobotConfig, ServoConfig
from hil.core.controller import Controller
from hil.core.model import ArmModel
from hil.core.settings import NS_PER_MS, ServoSettings
from hil.values.arm import Backend, PeerBackend
from hil.values.backend import BackendRequest
from hil.values.errors import ConfigurationError
from hil.values.fri import CLIENT_PORT
from hil.values.fri_messages import ControllerCodec
from hil.values.kst import KST_PORT
from hil.values.link import Address
from hil.values.robot import RobotDescription, Seven
from hil.values.servo import SERVO_PORT, ServoControllerCodec
from hil.values.surroundings import Surroundings
from hil.version import SOFTWARE
from transport.fri import FriCodec
from transport.servo import ServoCodec, load_key
from transport.udp import default_bind, parse_address, refuse_shared_port

TOKEN_SECRET_BYTES = 32


@dataclass(frozen=True, slots=True)
class FriAddresses:
    """Where the FRI client is, and where it is served from (port 0: any free one)."""

    peer: Address
    bind: Address


@dataclass(frozen=True, slots=True)
class LinkAddresses:
    """Resolved addresses of a robot's links; None for a link it has not."""

    fri: FriAddresses | None
    servo: Address | None
    kst: Address | None = None


def link_addresses(config: RobotConfig) -> LinkAddresses:
    """Return the resolved addresses of a robot's links; raise :class:`ConfigurationError`."""
    servo = None if config.servo is None else parse_address(config.servo.bind, default_port=SERVO_PORT)
    kst = None if config.kst is None else parse_address(config.kst.bind, default_port=KST_PORT)
    return LinkAddresses(_fri_addresses(config), servo, kst)


def _fri_addresses(config: RobotConfig) -> FriAddresses | None:
    if config.fri is None:
        return None
    peer = parse_address(config.fri.client, default_port=CLIENT_PORT)
    bind = default_bind(peer) if config.fri.bind is None else parse_address(config.fri.bind, default_port=CLIENT_PORT)
    refuse_shared_port(bind=bind, peer=peer)
    return FriAddresses(peer, bind)


def robot_description(config: RobotConfig) -> RobotDescription:
    """Return the description of a robot with the limits of its station; raise :class:`ConfigurationError`."""
    return config.limits.tighten(load_description(config.model))


def backend_of(config: RobotConfig, description: RobotDescription, surroundings: Surroundings | None = None) -> Backend:
    """Return the robot side a configuration names, not yet open; without ``surroundings`` it stands alone.

    Raises :class:`UnknownName` or :class:`ConfigurationError`.
    """
    return make_backend(
        config.backend,
        BackendRequest(
            robot=config.name,
            description=description,
            cycle_ns=config.cycle_ms * NS_PER_MS,
            options=config.options,
            seed=config.seed,
            load=config.true_load(),
            torque_noise=config.torque_noise,
            base_in_world=config.base.pose(),
            surroundings=surroundings or Surroundings(arms=(config.scene_arm(),)),
        ),
    )


@dataclass(frozen=True, slots=True)
class RobotParts:
    """What takes its time to load, ready for a controller."""

    description: RobotDescription
    model: ArmModel
    backend: Backend
    servo_codec: ServoControllerCodec | None


def make_servo_codec(config: ServoConfig) -> ServoCodec:
    """Return the codec of a robot's servo link, with its key; raise :class:`ConfigurationError`."""
    return ServoCodec(None if config.key_file is None else load_key(config.key_file))


def open_parts(
    config: RobotConfig,
    *,
    initial_position_rad: Seven | None = None,
    surroundings: Surroundings | None = None,
    live: bool = False,
) -> RobotParts:
    """Load a robot's models and open its backend, which the caller closes; the arm begins as described, or there.

    ``surroundings`` are those of its station, the same object for all its robots. Only a ``live`` run may move real
    drives: in a replay, a bench or a test time goes as it likes.

    Raises :class:`ConfigurationError`, :class:`UnknownName` or :class:`BackendError`.
    """
    description = robot_description(config)
    if initial_position_rad is not None:
        description = replace(description, initial_position_rad=initial_position_rad)
    servo_codec = None if config.servo is None else make_servo_codec(config.servo)
    backend = backend_of(config, description, surroundings)
    if backend.capabilities.moves_real_drives and not (live or backend.capabilities.paces_the_cycle):
        raise ConfigurationError(
            f"{config.name}: the backend {config.backend} moves real drives, and only hil run may: this is no live run"
        )
    if backend.capabilities.moves_real_drives and (config.permissive or config.enabled):
        wish = "permissive" if config.permissive else "enabled"
        raise ConfigurationError(f"{config.name}: the backend {config.backend} moves real drives: never {wish}")
    if config.fri is not None:
        peer = Address("127.0.0.1", CLIENT_PORT)
        config.fri.settings(peer).check_robot_side(backend.capabilities)
    model = ArmModel(load_pinocchio(description.name))
    backend.open(period_ns=config.cycle_ms * NS_PER_MS)
    return RobotParts(description, model, backend, servo_codec)


def tell_first_message(backend: Backend, datagram: bytes, sender: Address) -> str:
    """Give a robot side that is a network peer what came before the first cycle; return why it is not ready then."""
    if not isinstance(backend, PeerBackend):
        return ""
    backend.receive(datagram, sender, now_ns=0)
    return backend.not_ready()


def make_controller(
    config: RobotConfig,
    parts: RobotParts,
    *,
    unix_epoch_ns: int,
    fri_peer: Address | None,
    codec: ControllerCodec | None = None,
    token_secret: bytes | None = None,
    first_sequence_counter: int = 0,
    on_stage: Callable[[str], None] | None = None,
) -> Controller:
    """Return the controller of a robot whose core time 0 is ``unix_epoch_ns``; cheap, to be done at the start.

    ``codec`` takes the place of the one the configuration names; ``token_secret`` that of a new random one, so that
    the tokens of two runs are the same. The FRI link counts its messages from ``first_sequence_counter``.
    """
    secret = os.urandom(TOKEN_SECRET_BYTES) if token_secret is None else token_secret
    settings = config.settings(
        unix_epoch_ns=unix_epoch_ns, fri_peer=fri_peer, servo=_servo_settings(config, parts, secret)
    )
    if first_sequence_counter and settings.fri is not None:
        settings = replace(settings, fri=replace(settings.fri, first_sequence_counter=first_sequence_counter))
    return Controller(
        settings,
        description=parts.description,
        model=parts.model,
        backend=parts.backend,
        codec=FriCodec(config.fri.release) if codec is None and config.fri is not None else codec,
        servo_codec=parts.servo_codec,
        on_stage=on_stage,
    )


def _servo_settings(config: RobotConfig, parts: RobotParts, token_secret: bytes) -> ServoSettings | None:
    if config.servo is None:
        return None
    return ServoSettings(software=SOFTWARE, robot=parts.description.name, token_secret=token_secret)
