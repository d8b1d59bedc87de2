"""What a pad asks for, one JSON object a line: read from bytes, or refused in a sentence that says what is valid."""

import json
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, NoReturn

from hil.config.ring import RingSize, parse_ring
from hil.values.arm import DEFAULT_PUSH_S, Push
from hil.values.errors import ConfigurationError, PeerError
from hil.values.fri import OperationMode
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput, SetOverride
from hil.values.robot import JOINT_COUNT, Three

MAX_LINE_BYTES: Final = 4096
"""Longest request, without the end of its line."""
_SHOWN_CHARACTERS: Final = 60
_LARGEST_ID: Final = 1 << 53

RequestId = str | int | None


class PadRequest(NamedTuple):
    """One request; without an ``action`` it only looks."""

    action: OperatorAction | None = None
    watch: bool = False
    hold: bool = False
    """Whether the enabling switch is let go when the connection closes."""
    robot: str | None = None
    request_id: RequestId = None
    capture: "CaptureRequest | None" = None
    describe: bool = False
    """Whether it asks for what stays the same while the controller runs."""
    kst: bool = False
    """Whether it asks for what the KST servers did."""


class CaptureRequest(NamedTuple):
    """Begin a capture with the writer that listens at ``writer`` for ``file``; without one: end the one that runs."""

    writer: str = ""
    file: str = ""
    ring: RingSize | None = None


class BadRequest(NamedTuple):
    """Why a line is no request."""

    reason: str
    request_id: RequestId = None


def read_request(line: bytes) -> PadRequest | BadRequest:
    """Return what a line asks for; never raises."""
    try:
        fields = _object(line)
    except PeerError as refusal:
        return BadRequest(str(refusal))
    request_id = fields.get("id")
    if not _is_id(request_id):
        return BadRequest(f"id {_shown(request_id)} is neither a text nor a whole number up to 2^53")
    try:
        return _request(fields)._replace(request_id=request_id)
    except PeerError as refusal:
        return BadRequest(str(refusal), request_id)


def _object(line: bytes) -> dict[str, Any]:
    try:
        fields = json.loads(line.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise PeerError('a line is no JSON object in UTF-8; valid is for example {"do": "status"}') from error
    if not isinstance(fields, dict):
        raise PeerError(f'a line is {_shown(fields)}, no JSON object; valid is for example {{"do": "status"}}')
    return fields


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no JSON")


def _is_id(value: object) -> bool:
    if isinstance(value, str):
        return True
    return value is None or (isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _LARGEST_ID)


def _request(fields: Mapping[str, Any]) -> PadRequest:
    what = fields.get("do")
    if not isinstance(what, str) or what not in _REQUESTS:
        told = f"do {_shown(what)} is unknown" if "do" in fields else "there is no do"
        raise PeerError(f"{told}; valid: {', '.join(_REQUESTS)}")
    keys, read = _REQUESTS[what]
    valid = ["do", "robot", "id", *keys]
    for name in fields:
        if name not in valid:
            raise PeerError(f"there is no key {_shown(name)} in do {what}; valid: {', '.join(valid)}")
    robot = fields.get("robot")
    if robot is not None and not isinstance(robot, str):
        raise PeerError(f"robot {_shown(robot)} is no text")
    return read(what, fields)._replace(robot=robot)


def _press(what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest(Press(PadKey(what)))


def _enable(what: str, fields: Mapping[str, Any]) -> PadRequest:
    hold = fields.get("hold", False)
    if not isinstance(hold, bool):
        raise PeerError(f"hold {_shown(hold)} is neither true nor false")
    return PadRequest(Press(PadKey(what)), hold=hold)


def _mode(_what: str, fields: Mapping[str, Any]) -> PadRequest:
    mode, names = fields.get("mode"), [mode.name for mode in OperationMode]
    if not isinstance(mode, str) or mode not in names:
        raise PeerError(f"mode {_shown(mode)} is unknown; valid: {', '.join(names)}")
    return PadRequest(SelectMode(OperationMode[mode]))


def _override(_what: str, fields: Mapping[str, Any]) -> PadRequest:
    percent = fields.get("percent")
    if isinstance(percent, bool) or not isinstance(percent, int | float):
        raise PeerError(f"percent {_shown(percent)} is no number; valid: 0 ... 100")
    try:
        return PadRequest(SetOverride(float(percent)))
    except OverflowError as error:
        raise PeerError(f"percent {_shown(percent)} is no number a computer has; valid: 0 ... 100") from error


def _push(_what: str, fields: Mapping[str, Any]) -> PadRequest:
    link = fields.get("link", JOINT_COUNT)
    if isinstance(link, bool) or not isinstance(link, int):
        raise PeerError(f"link {_shown(link)} is no whole number; valid: 1 ... {JOINT_COUNT}")
    force, moment = (_three(fields.get(key, [0, 0, 0]), key) for key in ("force_n", "moment_nm"))
    [duration] = _numbers([fields.get("duration_s", DEFAULT_PUSH_S)], 1, "duration_s")
    return PadRequest(Push(link, force, moment, duration))


def _three(value: object, key: str) -> Three:
    x, y, z = _numbers(value, 3, key)
    return (x, y, z)


def _numbers(value: object, count: int, key: str) -> list[float]:
    if (
        not isinstance(value, list)
        or len(value) != count
        or any(isinstance(number, bool) or not isinstance(number, int | float) for number in value)
    ):
        raise PeerError(f"{key} {_shown(value)}: {count} numbers are needed")
    try:
        return [float(number) for number in value]
    except OverflowError as error:
        raise PeerError(f"{key} has a number no computer has") from error


def _io(_what: str, fields: Mapping[str, Any]) -> PadRequest:
    name, value = fields.get("name"), fields.get("value")
    if not isinstance(name, str):
        raise PeerError(f"name {_shown(name)} is no text; valid: the Group.Name of an input")
    if not isinstance(value, bool | int | float):
        raise PeerError(f"value {_shown(value)} is neither a number nor true or false")
    return PadRequest(SetInput(name, value))


def _capture(_what: str, fields: Mapping[str, Any]) -> PadRequest:
    what = fields.get("capture")
    if what == "stop":
        return PadRequest(capture=CaptureRequest())
    if what != "start":
        raise PeerError(f"capture {_shown(what)} is unknown; valid: start, stop")
    writer, file, ring = fields.get("writer"), fields.get("file"), fields.get("ring")
    if not isinstance(writer, str) or not isinstance(file, str) or not writer or not file:
        raise PeerError("a capture needs writer, the socket of the process that writes it, and file, its path")
    if ring is not None and not isinstance(ring, str):
        raise PeerError(f"ring {_shown(ring)} is no text; valid: FILESxSIZE, such as 10x100MB")
    try:
        return PadRequest(capture=CaptureRequest(writer, file, None if ring is None else parse_ring(ring)))
    except ConfigurationError as error:
        raise PeerError(str(error)) from error


def write_action(action: OperatorAction) -> dict[str, object]:
    """Return the request that asks for an action: what :func:`read_request` reads back from its JSON."""
    match action:
        case Press(key):
            return {"do": key.value}
        case SelectMode(mode):
            return {"do": "mode", "mode": mode.name}
        case SetOverride(percent):
            return {"do": "override", "percent": percent}
        case SetInput(name, value):
            return {"do": "io", "name": name, "value": value}
        case Push(link, force_n, moment_nm, duration_s):
            told = {"link": link, "force_n": list(force_n), "moment_nm": list(moment_nm)}
            return {"do": "push", **told, "duration_s": duration_s}


def _status(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest()


def _describe(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest(describe=True)


def _kst(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest(kst=True)


def _watch(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest(watch=True)


_REQUESTS: Final[Mapping[str, tuple[tuple[str, ...], Callable[[str, Mapping[str, Any]], PadRequest]]]] = {
    **{key.value: ((), _press) for key in PadKey},
    PadKey.ENABLE.value: (("hold",), _enable),
    "mode": (("mode",), _mode),
    "override": (("percent",), _override),
    "push": (("link", "force_n", "moment_nm", "duration_s"), _push),
    "io": (("name", "value"), _io),
    "capture": (("capture", "writer", "file", "ring"), _capture),
    "status": ((), _status),
    "watch": ((), _watch),
    "describe": ((), _describe),
    "kst": ((), _kst),
}
"""By ``do``: the keys it has beside those all have, and what reads it."""


def _shown(value: object) -> str:
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    text = json.dumps(value)
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."
