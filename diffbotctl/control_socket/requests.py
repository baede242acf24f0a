"""The requests of the control protocol: each is declared once, here, with its fields.

A request is a NamedTuple whose fields carry a type, a unit, bounds and a sentence. Parsing, the
checks, the error replies and the table in docs/protocol.md are made from these declarations; what
passes `parse_request` is not checked again.
"""

import json
from collections.abc import Collection, Iterable
from math import inf, isfinite
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from diffbotctl.control_socket.protocol import PROTOCOL, Fields, RefusalError
from diffbotctl.messages import LogLevel
from diffbotctl.units import POSE_MAX

TEXT_MAX_LENGTH = 200  # characters
POSITION_MAX_M = POSE_MAX["m"]  # no robot of this kind gets there: a typing error
HEADING_MAX_RAD = round(POSE_MAX["rad"], 1)
LOG_LINES_MAX = 500  # that the server keeps
ALL = "*"  # every topic, or every source of the log
ENVELOPE = ("id", "method")  # fields of every request


class RequestField(NamedTuple):
    """What a field means: one sentence, its unit, and its bounds (inclusive)."""

    help: str
    unit: str = ""
    minimum: float = -inf
    maximum: float = inf

    def limits_text(self) -> str:
        if self.maximum < inf:
            return f"{self.minimum:g} to {self.maximum:g} {self.unit}".rstrip()
        return f"at least {self.minimum:g} {self.unit}".rstrip()


Topic = Annotated[str, RequestField("name of a topic, also its ROS name")]
Position = RequestField("in the frame odom", "m", -POSITION_MAX_M, POSITION_MAX_M)
Heading = RequestField("final heading", "rad", -HEADING_MAX_RAD, HEADING_MAX_RAD)


class StopRequest(NamedTuple):
    """Stop the robot, and keep it stopped until `resume`."""

    reason: Annotated[str, RequestField("appears in the cause of the stop")] = ""


class ResumeRequest(NamedTuple):
    """End a stop that waits for an operator; a paused goal continues."""


class GotoRequest(NamedTuple):
    """Replace all goals by this one; after that no goal ends the run."""

    x: Annotated[float, Position]
    y: Annotated[float, Position]
    heading: Annotated[float | None, Heading] = None


class DriveRequest(NamedTuple):
    """Drive at a velocity, with priority over all goals; see Driving."""

    linear: Annotated[float, RequestField("forward speed", "m/s")] = 0.0
    angular: Annotated[float, RequestField("turn rate", "rad/s")] = 0.0
    take_over: Annotated[bool, RequestField("take control from another client")] = False
    time: Annotated[
        float | None, RequestField("logical time at which it was commanded", "ns", 0.0)
    ] = None
    lease: Annotated[
        float | None, RequestField("age (`time`) at which it is refused; default 0.3 s", "s", 0.0)
    ] = None


class ReleaseRequest(NamedTuple):
    """Stop driving in order: the wheels are commanded to zero, the robot is not stopped."""


class OperatorLostRequest(NamedTuple):
    """Report that the person for whom this client drives is unreachable: the robot is stopped."""

    reason: Annotated[str, RequestField("appears in the cause of the stop")] = (
        "the operator does not answer"
    )


class RearmRequest(NamedTuple):
    """End the stop that this client's own `operator_lost` caused; a paused goal stays paused."""


class StatusRequest(NamedTuple):
    """What stops the robot, what is commanded, the goal and its state, the limits."""


class SnapshotRequest(NamedTuple):
    """`messages`: the newest of every topic; `held`: what stops the robot; `time`."""


class SceneRequest(NamedTuple):
    """Walls, outline, sensors, limits: what a map draws and what does not change. `coast_time`:
    seconds by which the robot goes on at its speed."""


class ExplainStopRequest(NamedTuple):
    """`summary`: the last stop in a sentence; `text`: the chain of its causes."""


class ListTopicsRequest(NamedTuple):
    """Every topic with its type, rate and age."""


class DescribeTopicRequest(NamedTuple):
    """The type, fields as a JSON Schema and newest message; whether motion depends on it."""

    topic: Topic


class TopicRateRequest(NamedTuple):
    """The rate of a topic and the gaps between its messages."""

    topic: Topic


class ReadHistoryRequest(NamedTuple):
    """The last two minutes of a topic: `times` in s, `fields` with a value each, `trail` in m."""

    topic: Topic


class ReadMapRequest(NamedTuple):
    """The tiles of the map that have changed: `places`, `tiles`; `is_last`: there are no more."""

    map: Annotated[float, RequestField("number of the map whose tiles are known", "", 0)] = 0
    since: Annotated[float, RequestField("`number` of the last reply", "", 0)] = 0


class SubscribeRequest(NamedTuple):
    """Stream a topic from now on; `*` is all."""

    topic: Topic
    last: Annotated[bool, RequestField("send the newest message first")] = False


class UnsubscribeRequest(NamedTuple):
    """End the stream of a topic; `*` is all."""

    topic: Topic


class PublishRequest(NamedTuple):
    """Publish to an input, or to `operator.twist`, `.goal`, `.resume` or `.halt`."""

    topic: Topic
    message: Annotated[
        dict[str, Any], RequestField("fields of the topic's type, or of drive, goto, resume, stop")
    ]


class ListParametersRequest(NamedTuple):
    """Every parameter with value, unit, and whether it is live."""


class SetParameterRequest(NamedTuple):
    """Change a live parameter."""

    parameter: Annotated[str, RequestField("block and key, such as guard.margin")]
    value: Annotated[Any, RequestField('in SI units, or a text with a unit: "8 cm"')]


class ListActionsRequest(NamedTuple):
    """Every action that can be called, with its arguments."""


class CallActionRequest(NamedTuple):
    """Call an action of a block; when it is done the reply has in `value` what it returned."""

    action: Annotated[str, RequestField("block and action, such as odometry.set_pose")]
    arguments: Annotated[dict[str, Any], RequestField("numbers in SI units, and texts")] = {}


class ListBlocksRequest(NamedTuple):
    """Every block with its rate, its processor load and its last error; see Blocks."""


class ListWiresRequest(NamedTuple):
    """Every wire with its rate."""


class ReadLogRequest(NamedTuple):
    """`lines`: the newest lines of the log, the oldest of them first."""

    last: Annotated[float, RequestField("number of lines", "", 0, LOG_LINES_MAX)] = 50
    level: Annotated[LogLevel, RequestField("lowest level")] = "debug"
    block: Annotated[str, RequestField("one source, * for all")] = ALL


class SetLogLevelRequest(NamedTuple):
    """Log the lines of a block from this level on; `*` is all blocks."""

    block: Annotated[str, RequestField("one source, * for all")]
    level: Annotated[LogLevel, RequestField("lowest level")]


class SaveBlackBoxRequest(NamedTuple):
    """Begin to save the last three minutes; the reply has `file`, `number` and `is_written`."""

    number: Annotated[
        float, RequestField("ask whether this file has been written; 0: save", "", 0, 1e6)
    ] = 0.0


class FieldDeclaration(NamedTuple):
    """A field of a request. `kind` is `object` for any value; `choices` are those of a Literal."""

    kind: type
    choices: tuple[str, ...]
    is_optional: bool  # null is allowed
    is_required: bool
    field: RequestField


DECLARED: dict[type, dict[str, FieldDeclaration]] = {}  # by request class, filled on first use


def declared_fields(request: type) -> dict[str, FieldDeclaration]:
    """The declarations of the fields of a request class, in order."""
    if request not in DECLARED:
        defaults = getattr(request, "_field_defaults", {})
        DECLARED[request] = {}
        for name, annotated in get_type_hints(request, include_extras=True).items():
            hint, field = get_args(annotated)
            DECLARED[request][name] = _declaration(hint, field, name not in defaults)
    return DECLARED[request]


def _declaration(hint: Any, field: RequestField, is_required: bool) -> FieldDeclaration:
    choices = get_args(hint) if get_origin(hint) is Literal else ()
    kinds = [kind for kind in KINDS if kind in (hint, get_origin(hint), *get_args(hint))]
    kind = str if choices else kinds[0] if kinds else object
    return FieldDeclaration(kind, choices, type(None) in get_args(hint), is_required, field)


KINDS: dict[type, str] = {
    float: "a finite number",
    bool: "true or false",
    dict: "an object",
    str: f"a printable text of at most {TEXT_MAX_LENGTH} characters",
    object: "present",
}
R = TypeVar("R")


def parse_request(request: type[R], fields: Fields) -> R:
    """The request of this class in `fields`. Raises RefusalError for what it does not declare."""
    declarations = declared_fields(request)
    refuse_unknown(set(fields) - set(ENVELOPE), declarations)
    return request(
        **{
            name: _value(name, declaration, fields)
            for name, declaration in declarations.items()
            if name in fields or declaration.is_required
        }
    )


def refuse_unknown(names: Iterable[str], known: Collection[str]) -> None:
    """Raise RefusalError for a name that is not known: a misspelt field must not be ignored."""
    for name in sorted(set(names) - set(known)):
        fix = f"it takes {', '.join(known)}" if known else "it takes none"
        raise RefusalError("E-REQUEST", f"there is no field '{name[:40]}' here", fix)


def _value(name: str, declaration: FieldDeclaration, fields: Fields) -> Any:
    kind, choices, is_optional, _, field = declaration
    if name not in fields:
        raise wrong_field(name, kind, field.unit)
    value = given = fields[name]
    if value is None and is_optional:
        return None
    if kind is float:
        value = finite(value)
    is_text = isinstance(value, str) and len(value) <= TEXT_MAX_LENGTH and value.isprintable()
    if not isinstance(value, kind) or (kind is str and not is_text):
        raise wrong_field(name, kind, field.unit, given)
    if choices and value not in choices:
        cause = f"there is no {name} '{value}'"
        raise RefusalError("E-REQUEST", cause, f"there are {', '.join(choices)}")
    if isinstance(value, float) and not field.minimum <= value <= field.maximum:
        limits = field.limits_text()
        raise RefusalError("E-REQUEST", f"the field '{name}' must be {limits}; it is {value:g}")
    return value


def finite(value: Any) -> float | None:
    """`value` as a float; None when it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # a whole number of more than 308 digits
        return None
    return number if isfinite(number) else None


def wrong_field(name: str, kind: type, unit: str, value: Any = None) -> RefusalError:
    """The refusal of a field that is missing (`value` None), or whose value is no `kind`."""
    expected = f"{KINDS[kind]} ({unit})" if unit else KINDS[kind]
    actual = "is missing" if value is None else f"is {json.dumps(value)[:40]}"
    return RefusalError("E-REQUEST", f"the field '{name}' must be {expected}; it {actual}")


class _ClientName(NamedTuple):
    name: Annotated[str, RequestField("appears in logs and in the cause of a stop")]


def parse_hello(fields: Fields) -> str:
    """The name in the first line of a client. Raises RefusalError for an unknown protocol."""
    protocol = fields.get("hello")
    if type(protocol) is not int:
        fix = f'send {{"hello": {PROTOCOL}}} first'
        raise RefusalError("E-PROTOCOL", "the first line must be a hello", fix)
    if protocol != PROTOCOL:
        cause = f"protocol {protocol % 10**9} is not supported; this is protocol {PROTOCOL}"
        fix = "install the same version of diffbotctl on both sides"
        raise RefusalError("E-PROTOCOL", cause, fix)
    return parse_request(_ClientName, {"name": fields.get("name", "client")}).name
