"""What a pad asks for, one JSON object a line: read from bytes, or refused in a sentence that says what is valid."""

import json
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, NoReturn

from hil.values.errors import PeerError
from hil.values.fri import OperationMode
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetOverride

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
    key, read = _REQUESTS[what]
    valid = ["do", "robot", "id", *([key] if key else [])]
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


def _status(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest()


def _watch(_what: str, _fields: Mapping[str, Any]) -> PadRequest:
    return PadRequest(watch=True)


_REQUESTS: Final[Mapping[str, tuple[str, Callable[[str, Mapping[str, Any]], PadRequest]]]] = {
    **{key.value: ("", _press) for key in PadKey},
    PadKey.ENABLE.value: ("hold", _enable),
    "mode": ("mode", _mode),
    "override": ("percent", _override),
    "status": ("", _status),
    "watch": ("", _watch),
}
"""By ``do``: the key it has beside those all have, and what reads it."""


def _shown(value: object) -> str:
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    text = json.dumps(value)
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."
