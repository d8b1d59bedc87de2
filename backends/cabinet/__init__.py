"""The link to a real Sunrise Cabinet: an FRI client towards the robot, sans-I/O; the robot side of applications."""

from collections.abc import Mapping

from backends.cabinet.capabilities import capabilities
from hil.values.arm import Backend, Capabilities
from hil.values.backend import BackendPlugin, BackendRequest
from hil.values.fri import OverlayKind


def _make(request: BackendRequest) -> Backend:
    from backends.cabinet.backend import CabinetBackend
    from backends.cabinet.options import parse_options

    return CabinetBackend(parse_options(request.options), cycle_ns=request.cycle_ns)


def _check(options: Mapping[str, object]) -> None:
    from backends.cabinet.options import parse_options

    parse_options(options)


def _capabilities() -> Capabilities:
    return capabilities(OverlayKind.JOINT_POSITION)


PLUGIN = BackendPlugin(
    summary="a real Sunrise Cabinet, or another controller of this kind, over FRI",
    make=_make,
    capabilities=_capabilities,
    check_options=_check,
    options_help={
        "release": "release of FRI that the Cabinet speaks: 1.11, 1.14, 1.15 (the default), 1.16, 2.5, 2.7",
        "bind": "ADDR[:PORT] the Cabinet sends to; 0.0.0.0:30200, and a real one sends to 30200 ... 30209 only",
        "cabinet": "HOST[:PORT] of the Cabinet, which alone is believed; default: the first one that can be read",
        "overlay": "what its motion takes: joint-position (the default), torque or wrench",
        "connect_s": "how long to wait for its first message; 10",
        "silence_ms": "silence that is a failure; 10, or three cycles where that is longer",
        "shadow": "true: only watch, never command",
    },
)
