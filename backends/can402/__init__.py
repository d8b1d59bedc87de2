"""Seven CiA 402 drives on a CAN bus, in cyclic synchronous position mode; and simulated ones."""

from collections.abc import Mapping

from backends.can402.capabilities import capabilities
from hil.values.arm import Backend, Capabilities
from hil.values.backend import BackendPlugin, BackendRequest

_INSTALL = "pip install 'fri-hil[can]'"


def _make(request: BackendRequest) -> Backend:
    from backends.can402.backend import Can402Backend
    from backends.can402.options import parse_options

    return Can402Backend(parse_options(request.options), start_rad=request.description.initial_position_rad)


def _check(options: Mapping[str, object]) -> None:
    from backends.can402.options import parse_options

    parse_options(options)


def _capabilities() -> Capabilities:
    return capabilities(simulated=False)


PLUGIN = BackendPlugin(
    summary="seven CiA 402 drives on a CAN bus, cyclic synchronous position",
    make=_make,
    capabilities=_capabilities,
    check_options=_check,
    options_help={
        "interface": "python-can's name of the interface: socketcan (the default), slcan, pcan, ...",
        "channel": "python-can's name of the channel: can0 (the default), /dev/ttyACM0, ...",
        "bitrate": "bit/s of the bus; 1000000",
        "simulated": "true: seven simulated drives in this process, on python-can's virtual bus",
        "eds": "EDS file of the drives: their identity must be the one it tells",
        "nodes": "node numbers of A1 to A7; [1, 2, 3, 4, 5, 6, 7]",
        "axis": "one table for all axes, or seven: counts_per_turn, gear, sign, offset_rad, rated_torque_nm",
        "heartbeat_ms": "period of the drives' heartbeat, and of ours; 100",
        "enable_timeout_s": "how long the drives may take to operation enabled; 5",
        "lost_after": "SYNCs in a row without an answer that make a drive a lost one; 3",
    },
    needs={"can": _INSTALL, "canopen": _INSTALL},
    replays=False,
)
