"""An arm with soft joints, as a robot side of fri-hil.

To load this module is cheap, because fri-hil loads the plugin of every backend it lists; the arm is imported when one
is made.
"""

from collections.abc import Mapping

from hil.values.arm import Backend, Capabilities
from hil.values.backend import BackendPlugin, BackendRequest


def _make(request: BackendRequest) -> Backend:
    from elastic_arm.arm import ElasticArm
    from elastic_arm.options import parse_options

    return ElasticArm(request.description.initial_position_rad, parse_options(request.options))


def _capabilities() -> Capabilities:
    from elastic_arm.arm import CAPABILITIES

    return CAPABILITIES


def _check_options(options: Mapping[str, object]) -> None:
    from elastic_arm.options import parse_options

    parse_options(options)


PLUGIN = BackendPlugin(
    summary="motors that follow exactly, and links that swing after them on springs",
    make=_make,
    capabilities=_capabilities,
    check_options=_check_options,
    options_help={
        "frequency_hz": "of a link on its spring, 1 ... 40; 12",
        "damping_ratio": "of that swing, 0.05 ... 2; 0.7",
    },
)
