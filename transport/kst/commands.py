"""All commands as one table, and what a line asks for by it."""

import math
from enum import StrEnum
from typing import Final, NamedTuple

from transport.kst.numbers import java_double

AXES: Final = 7
_POSE: Final = 6


class Served(StrEnum):
    """When a command is served."""

    ALWAYS = "always"
    """At once, in every state."""
    IDLE = "idle"
    """By what also does the motions: published servers are silent while one runs, or a real-time mode."""


class Feedback(StrEnum):
    """What the reply is."""

    DONE = "done"
    NOTHING = "nothing"
    JOINTS = "joint positions"
    POSE = "pose"
    FORCE = "force"
    MOMENT = "moment"
    EXTERNAL_TORQUES = "external torques"
    MEASURED_TORQUES = "measured torques"
    PIN = "pin"


class Command(StrEnum):
    """What is to be done."""

    END = "end the session"
    ATTACH_TOOL = "attach a tool"
    QUERY = "query"
    READ_INPUT = "read an input"
    SET_OUTPUT = "set an output"
    SET_JOINTS = "joint target"
    SET_VELOCITIES = "joint velocities"
    SET_SERVO_POSE = "Cartesian set-point"
    SET_POSE = "Cartesian target"
    SET_CIRCLE_AUXILIARY = "auxiliary point of a circle"
    SET_CIRCLE_END = "end point of a circle"
    SET_SPEED = "speed"
    MOVE_JOINTS = "joint motion"
    MOVE_LINE = "line"
    MOVE_LINE_IN_BASE = "relative line in base axes"
    MOVE_LINE_IN_TOOL = "relative line in tool axes"
    MOVE_CIRCLE = "circle"
    MOVE_JOINTS_UNTIL = "conditional joint motion"
    MOVE_LINE_UNTIL = "conditional line"
    MOVE_CIRCLE_UNTIL = "conditional circle"
    START_JOINT_SERVO = "start joint servo"
    START_CARTESIAN_SERVO = "start Cartesian servo"
    START_VELOCITY_SERVO = "start velocity servo"
    START_IMPEDANCE = "start impedance"
    STOP_SERVO = "stop servo"
    HAND_GUIDING = "hand guiding"


class Problem(StrEnum):
    """Why a line is refused; counted by it."""

    TOO_LONG = "line too long"
    NO_END = "line without an end"
    NOT_TEXT = "no text"
    UNKNOWN = "unknown command"
    NO_NUMBER = "no number"
    NOT_FINITE = "not finite"
    TOO_FEW = "too few values"
    TOO_MANY = "too many values"
    OUT_OF_RANGE = "out of range"
    BUSY = "busy"
    NOT_POSSIBLE = "not possible"


class Spec(NamedTuple):
    """One command: the beginning of its line, when it is served, how many numbers it has, what is answered."""

    token: str
    command: Command
    served: Served
    values: int | None = None
    """How many numbers follow; None: any, and nobody reads them."""
    reply: Feedback = Feedback.DONE
    exact: bool = False
    """Whether the line is the token and nothing else."""
    published: bool = True
    """Whether published servers know it. Where not, published clients send it all the same, and wait for ever."""


_S, _M = Served.ALWAYS, Served.IDLE
_OUTPUTS: Final = ("blueOn", "blueOff", *(f"pin{pin}{state}" for pin in (1, 2, 11, 12) for state in ("on", "off")))
_INPUTS: Final = ("getPin3", "getPin4", "getPin10", "getPin13", "getPin16")
_FEEDBACK: Final = (
    ("ExT_", Feedback.EXTERNAL_TORQUES),
    ("MT_", Feedback.MEASURED_TORQUES),
    ("JP_", Feedback.JOINTS),
    ("EEfP_", Feedback.POSE),
)

COMMANDS: Final[tuple[Spec, ...]] = (
    Spec("end", Command.END, _S, None, Feedback.NOTHING),
    *(Spec(token, Command.SET_OUTPUT, _S) for token in _OUTPUTS),
    *(Spec(token, Command.READ_INPUT, _S, None, Feedback.PIN) for token in _INPUTS),
    Spec("getJointsPositions", Command.QUERY, _S, None, Feedback.JOINTS),
    Spec("jp_", Command.SET_JOINTS, _S, AXES),
    Spec("jf_", Command.SET_JOINTS, _S, AXES, Feedback.NOTHING),
    *(Spec(f"jp{token}", Command.SET_JOINTS, _S, AXES, reply) for token, reply in _FEEDBACK),
    Spec("jpEEfFrelEEF_", Command.SET_JOINTS, _S, AXES, Feedback.FORCE),
    Spec("velJDC_", Command.SET_VELOCITIES, _S, AXES),
    *(Spec(f"velJDC{token}", Command.SET_VELOCITIES, _S, AXES, reply) for token, reply in _FEEDBACK),
    Spec("cArtixanPosition_", Command.SET_POSE, _S, _POSE),
    Spec("cArtixanPositionCirc1_", Command.SET_CIRCLE_AUXILIARY, _S, _POSE),
    Spec("cArtixanPositionCirc2_", Command.SET_CIRCLE_END, _S, _POSE),
    Spec("DcSeCar_", Command.SET_SERVO_POSE, _S, _POSE, Feedback.NOTHING),
    *(Spec(f"DcSeCar{token}", Command.SET_SERVO_POSE, _S, _POSE, reply) for token, reply in _FEEDBACK),
    Spec("DcSeCarEEfFrelEEF_", Command.SET_SERVO_POSE, _S, _POSE, Feedback.FORCE),
    Spec("DcSeCarW_", Command.SET_SERVO_POSE, _S, _POSE, published=False),
    Spec("stopDirectServoJoints", Command.STOP_SERVO, _S),
    Spec("TFtrans_", Command.ATTACH_TOOL, _M, _POSE),
    Spec("Eef_pos", Command.QUERY, _M, None, Feedback.POSE, exact=True),
    Spec("Eef_force", Command.QUERY, _M, None, Feedback.FORCE, exact=True),
    Spec("Eef_moment", Command.QUERY, _M, None, Feedback.MOMENT, exact=True),
    Spec("Torques_ext_J", Command.QUERY, _M, None, Feedback.EXTERNAL_TORQUES),
    Spec("Torques_m_J", Command.QUERY, _M, None, Feedback.MEASURED_TORQUES),
    Spec("jRelVel_", Command.SET_SPEED, _M, 1),
    Spec("doPTPinJS", Command.MOVE_JOINTS, _M),
    Spec("doPTPinCSRelEEF", Command.MOVE_LINE_IN_TOOL, _M),
    Spec("doPTPinCSRelBase", Command.MOVE_LINE_IN_BASE, _M),
    Spec("doPTPinCSCircle1", Command.MOVE_CIRCLE, _M),
    Spec("doPTPinCS", Command.MOVE_LINE, _M),
    Spec("doPTP!inJS", Command.MOVE_JOINTS_UNTIL, _M),
    Spec("doPTP!inCS", Command.MOVE_LINE_UNTIL, _M),
    Spec("doPTP!CSCircle1", Command.MOVE_CIRCLE_UNTIL, _M),
    Spec("startDirectServoJoints", Command.START_JOINT_SERVO, _M),
    Spec("stDcEEf_", Command.START_CARTESIAN_SERVO, _M),
    Spec("stVelDcJoint_", Command.START_VELOCITY_SERVO, _M),
    Spec("startSmartImpedneceJoints", Command.START_IMPEDANCE, _M, AXES),
    Spec("startSmartImpedanceJoints", Command.START_IMPEDANCE, _M, AXES, published=False),
    Spec("handGuiding", Command.HAND_GUIDING, _M),
    Spec("preciseHandGuiding", Command.HAND_GUIDING, _M),
)
"""In the order in which a line is compared with their beginnings."""


class Request(NamedTuple):
    """A line that is well formed. ``values`` are as many as the command has; ``text`` is the line."""

    spec: Spec
    values: tuple[float, ...]
    text: str


class Refused(NamedTuple):
    """A line that is not; ``sentence`` says what is wrong with it, ``spec`` is its command where it has one."""

    problem: Problem
    sentence: str
    text: str
    spec: Spec | None = None
    values: tuple[float, ...] = ()
    """Numbers that could be read before the wrong one, or all where their count is wrong."""


def read_request(line: bytes) -> Request | Refused | None:
    """Return what a line asks for; None for an empty one. Never raises."""
    if not line:
        return None
    text = line.decode("ascii", "replace")
    if not line.isascii() or not text.isprintable():
        return Refused(Problem.NOT_TEXT, f"{shown(text)} is no line of printable ASCII", text, _spec_of(text))
    spec = _spec_of(text)
    if spec is None:
        return Refused(Problem.UNKNOWN, f"there is no command {shown(text)}{_hint(text)}", text)
    fields = [field for field in text[len(spec.token) :].split("_") if field]
    if spec.command in _CONDITIONAL:
        return _read_triplets(spec, fields, text)
    if spec.values is None:
        return Request(spec, (), text)
    return _read_values(spec, fields, text)


_CONDITIONAL: Final = (Command.MOVE_JOINTS_UNTIL, Command.MOVE_LINE_UNTIL, Command.MOVE_CIRCLE_UNTIL)


def _spec_of(text: str) -> Spec | None:
    for spec in COMMANDS:
        if text == spec.token if spec.exact else text.startswith(spec.token):
            return spec
    return None


def _read_values(spec: Spec, fields: list[str], text: str) -> Request | Refused:
    wanted = spec.values or 0
    values, refused = _numbers(spec, fields, text)
    if refused is not None:
        return refused
    if len(values) != wanted:
        problem = Problem.TOO_FEW if len(values) < wanted else Problem.TOO_MANY
        sentence = f"{spec.token.rstrip('_')} has {len(values)} values, {wanted} are needed: {shown(text)}"
        return Refused(problem, sentence, text, spec, values)
    return Request(spec, values, text)


def _read_triplets(spec: Spec, fields: list[str], text: str) -> Request | Refused:
    # "doPTP!inCSRelBase_..." is a conditional line for a published server: the rest of its name is no number.
    numbers = fields if text[len(spec.token) : len(spec.token) + 1] in ("", "_") else fields[1:]
    values, refused = _numbers(spec, numbers, text)
    if refused is not None:
        return refused
    if len(values) % 3 or len(values) > 3 * AXES:
        problem = Problem.TOO_FEW if len(values) % 3 else Problem.TOO_MANY
        sentence = f"{spec.token} has {len(values)} values, triplets of axis, least and most are needed: {shown(text)}"
        return Refused(problem, sentence, text, spec, values)
    return Request(spec, values, text)


def _numbers(spec: Spec, fields: list[str], text: str) -> tuple[tuple[float, ...], Refused | None]:
    """Return the numbers of ``fields``, and what is wrong with the first one that is none."""
    values: list[float] = []
    for place, field in enumerate(fields, 1):
        try:
            value = java_double(field)
        except ValueError:
            sentence = f"value {place} of {spec.token.rstrip('_')} is {shown(field)}, which is no number"
            return tuple(values), Refused(Problem.NO_NUMBER, sentence, text, spec, tuple(values))
        values.append(value)
    for place, value in enumerate(values, 1):
        if not math.isfinite(value):
            sentence = f"value {place} of {spec.token.rstrip('_')} is {value}, a finite number is needed"
            return tuple(values), Refused(Problem.NOT_FINITE, sentence, text, spec, tuple(values))
    return tuple(values), None


def _hint(text: str) -> str:
    for spec in COMMANDS:
        if spec.exact and text.startswith(spec.token):
            return f"; {spec.token} stands alone in its line"
    folded = text.casefold()
    for spec in COMMANDS:
        if folded.startswith(spec.token.casefold()):
            return f"; did you mean {spec.token}?"
    return ""


def shown(text: str, most: int = 60) -> str:
    """Return a line as the log shows it: quoted, its beginning only, and nothing in it that acts on a terminal."""
    return repr(text if len(text) <= most else f"{text[:most]}...")
