"""Which rig is behind a name: ``mujoco``, ``mujoco:seed=2``, ``cabinet``, ``can402``, or anybody's own backend."""

import tomllib
from typing import Any, Final, NamedTuple

from backends.registry import backend_names, load_plugin, make_backend, missing_of
from backends.rig import InProcessRig, Rig
from backends.robots import load_description
from hil.values.backend import BackendRequest
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import Release

CABINET: Final = "cabinet"
DRIVES: Final = "can402"
_ARMS: Final = ("ideal", "mujoco")
_CYCLE_MS: Final = {DRIVES: 4}
"""Where a backend does not hold the shortest cycle."""


class Side(NamedTuple):
    """One robot side of a comparison: a backend and its options."""

    text: str
    """As it was named."""
    backend: str
    options: dict[str, Any]

    @property
    def cycle_ms(self) -> int:
        """The shortest control cycle it holds."""
        return _CYCLE_MS.get(self.backend, 1)


def parse_side(text: str) -> Side:
    """Return the side that ``NAME[:OPTION=VALUE,...]`` names; raise :class:`UsageError` for one there is not."""
    name, _, rest = text.partition(":")
    if name not in backend_names():
        raise UnknownName("backend", name, backend_names())
    if missing := missing_of(load_plugin(name)):
        raise ConfigurationError(f"the backend {name!r} needs more than is installed: {missing}")
    options: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        option, equals, value = part.partition("=")
        if not equals:
            raise ConfigurationError(f"{text!r}: {part!r} is no OPTION=VALUE")
        try:
            options[option] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            options[option] = value
    return Side(text, name, options)


def make_rig(side: Side, *, robot: str, cycle_ms: int) -> Rig:
    """Return the robot side on the bench, not open; raise :class:`ConfigurationError` for one that would be real."""
    if side.backend == CABINET:
        return _chained(side, robot)
    if side.backend == DRIVES:
        from backends.can402.options import parse_options
        from tools.conformance.simulated_drives import SimulatedDrivesRig

        return SimulatedDrivesRig(load_description(robot), parse_options({**side.options, "simulated": True}))
    capabilities = load_plugin(side.backend).capabilities()
    if capabilities.moves_real_drives or capabilities.paces_the_cycle:
        raise ConfigurationError(
            f"{side.backend} moves real drives, or is paced by somebody else: it is not compared on the bench"
        )
    options = dict(side.options)
    seed, torque_noise = options.pop("seed", 0), options.pop("torque_noise", True)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise ConfigurationError(f"{side.text!r}: seed {seed!r} is no whole number from 0")
    request = BackendRequest(
        robot="arm",
        description=load_description(robot),
        cycle_ns=cycle_ms * 1_000_000,
        options=options,
        seed=seed,
        torque_noise=bool(torque_noise),
    )
    return InProcessRig(make_backend(side.backend, request))


def _chained(side: Side, robot: str) -> Rig:
    from backends.ideal import IdealBackend
    from backends.mujoco import MujocoBackend
    from tools.conformance.chained_cabinet import ChainedCabinetRig

    options = dict(side.options)
    arm, release = options.pop("arm", "ideal"), str(options.pop("release", Release.V1_15))
    if options:
        raise ConfigurationError(f"{side.text!r}: there is no {next(iter(options))!r}; valid: arm, release")
    if arm not in _ARMS:
        raise UnknownName("arm of a chained Cabinet", str(arm), _ARMS)
    if release not in [*Release]:
        raise UnknownName("release", release, [*Release])
    return ChainedCabinetRig(
        robot=robot, arm=IdealBackend if arm == "ideal" else MujocoBackend, release=Release(release)
    )
