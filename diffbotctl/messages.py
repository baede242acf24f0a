"""The records that travel along wires: typed, immutable, SI units, right-handed frames.

x points forward, y left, headings turn counter-clockwise (REP-103); poses are in the frame `odom`,
velocities in `base_link` (REP-105). Every message begins with `time`: integer nanoseconds of the
engine's logical clock at which its content was true. A field is declared once, here, with its unit
and a sentence; schemas, recordings and reference pages are made from these declarations.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, get_args, get_type_hints


class Field(NamedTuple):
    """What a message field means: its SI unit ("" where it has none) and one sentence."""

    unit: str
    help: str


CommandKind = Literal["wheels", "duty"]
RangeState = Literal["clear", "measured", "too_close", "fault"]
GoalPhase = Literal["idle", "turning", "driving", "aligning"]
GoalEnd = Literal["reached", "blocked", "stuck", "timed_out"]
LinkState = Literal["opening", "negotiating", "up", "stale", "lost"]
LogLevel = Literal["debug", "info", "warning", "error"]
LOG_LEVELS: tuple[LogLevel, ...] = get_args(LogLevel)  # in order of severity
# Codes of the stops that the blocks and the gate of this package cause; another package's block
# may have codes of its own.
StopCode = Literal[
    "",
    "operator_stop",
    "operator_lost",
    "obstacle",
    "too_close",
    "range_fault",
    "range_stale",
    "telemetry_stale",
    "link_lost",
    "reconnect",
    "board_restart",
    "command_stale",
    "gate_limit",
]

Time = Annotated[int, Field("ns", "Logical time at which the content was true.")]
Metres = Annotated[float, Field("m", "A length.")]


class Encoders(NamedTuple):
    """Both wheels' counts, taken at one moment, with the commands then in force.

    Counts are unwrapped and signed by the board's idea of direction. `boot` changes when the board
    has restarted; counts then start anew and no difference may be taken across the change.
    """

    time: Time
    left: Annotated[int, Field("count", "Unwrapped count of the left encoder.")]
    right: Annotated[int, Field("count", "Unwrapped count of the right encoder.")]
    left_edge: Annotated[int | None, Field("ns", "Time of the left encoder's last edge.")] = None
    right_edge: Annotated[int | None, Field("ns", "Time of the right encoder's last edge.")] = None
    left_command: Annotated[float, Field("see kind", "Left command in force on the board.")] = 0.0
    right_command: Annotated[float, Field("see kind", "Right command in force on the board.")] = 0.0
    command_kind: Annotated[CommandKind, Field("", "`wheels` (rad/s) or `duty` (-1 to 1).")] = (
        "wheels"
    )
    command_time: Annotated[int | None, Field("ns", "When that command took hold, if known.")] = (
        None
    )
    boot: Annotated[int, Field("", "Changes whenever the board has restarted.")] = 0


class Volts(NamedTuple):
    """A raw sensor voltage; `nan` when the board reported a fault."""

    time: Time
    volts: Annotated[float, Field("V", "Voltage at the board's pin.")]


class Range(NamedTuple):
    """One distance along a sensor's axis."""

    time: Time
    distance: Annotated[float, Field("m", "Distance; the reach when clear, 0 when too close.")]
    state: Annotated[RangeState, Field("", "`clear`, `measured`, `too_close` or `fault`.")]


class Scan(NamedTuple):
    """Distances at equal steps of bearing, in the sensor's frame."""

    time: Time
    start: Annotated[float, Field("rad", "Bearing of the first ray.")]
    step: Annotated[float, Field("rad", "Bearing from one ray to the next.")]
    distances: Annotated[
        tuple[float, ...], Field("m", "One a ray: inf when clear, 0 when too close.")
    ]


class Odometry(NamedTuple):
    """Pose of base_link in odom, velocity in base_link."""

    time: Time
    x: Annotated[float, Field("m", "Position forward of the start.")]
    y: Annotated[float, Field("m", "Position left of the start.")]
    heading: Annotated[float, Field("rad", "Heading, unwrapped.")]
    linear: Annotated[float, Field("m/s", "Forward speed.")]
    angular: Annotated[float, Field("rad/s", "Turn rate.")]
    covariance: Annotated[
        tuple[float, float, float, float, float, float],
        Field("m, rad", "Upper triangle of the covariance of (x, y, heading): xx xy xh yy yh hh."),
    ]


class Twist(NamedTuple):
    """Desired velocity of base_link."""

    time: Time
    linear: Annotated[float, Field("m/s", "Forward speed.")]
    angular: Annotated[float, Field("rad/s", "Turn rate.")]


class Wheels(NamedTuple):
    """Desired wheel speeds; positive drives forward."""

    time: Time
    left: Annotated[float, Field("rad/s", "Left wheel.")]
    right: Annotated[float, Field("rad/s", "Right wheel.")]


class Duty(NamedTuple):
    """Desired motor duty for boards that take nothing else; positive drives forward."""

    time: Time
    left: Annotated[float, Field("1", "Left motor, -1 to 1.")]
    right: Annotated[float, Field("1", "Right motor, -1 to 1.")]


class Goal(NamedTuple):
    """A pose to reach in odom; `number` tells one goal from the next, 0 withdraws the last one."""

    time: Time
    number: Annotated[int, Field("", "Rises with every goal; 0 means no goal.")]
    x: Annotated[float, Field("m", "Where, forward.")] = 0.0
    y: Annotated[float, Field("m", "Where, left.")] = 0.0
    heading: Annotated[float | None, Field("rad", "Final heading, or none.")] = None


class Path(NamedTuple):
    """All waypoints in one message, in order."""

    time: Time
    goals: Annotated[tuple[Goal, ...], Field("", "Waypoints in the order to visit them.")]


class GoalState(NamedTuple):
    """How the goal that is under way is doing."""

    time: Time
    number: Annotated[int, Field("", "Number of the goal this speaks of.")]
    state: Annotated[
        Literal[GoalPhase, GoalEnd],
        Field(
            "",
            "`idle`, `turning`, `driving`, `aligning`, or how it ended: `reached`, "
            "`blocked`, `stuck`, `timed_out`.",
        ),
    ]
    distance: Annotated[float, Field("m", "Distance left to the goal.")]
    turn: Annotated[float, Field("rad", "Heading error left.")]
    cause: Annotated[str, Field("", "Why, in words, when it ended badly.")] = ""


class Stop(NamedTuple):
    """The robot is held still, or released again when `code` is empty."""

    time: Time
    code: Annotated[str, Field("", "Which rule stopped it; empty when nothing holds it.")]
    cause: Annotated[str, Field("", "Why, in words.")]
    latched: Annotated[bool, Field("", "True when only `resume` ends it.")]


class Link(NamedTuple):
    """Health of the link to the board."""

    time: Time
    state: Annotated[LinkState, Field("", "`opening`, `negotiating`, `up`, `stale` or `lost`.")]
    received: Annotated[int, Field("", "Good frames since the start.")] = 0
    damaged: Annotated[int, Field("", "Frames or bytes thrown away as damaged.")] = 0
    lost: Annotated[int, Field("", "Frames missing from the sequence.")] = 0
    restarts: Annotated[int, Field("", "Times the board has restarted.")] = 0
    latency: Annotated[float, Field("s", "Last time from command to echo; nan if unknown.")] = (
        float("nan")
    )
    cause: Annotated[str, Field("", "Why it is not up, in words.")] = ""


class Battery(NamedTuple):
    """The motor supply."""

    time: Time
    volts: Annotated[float, Field("V", "Supply voltage.")]
    low: Annotated[bool, Field("", "True below the robot file's low limit.")] = False


class Text(NamedTuple):
    """Words."""

    time: Time
    text: Annotated[str, Field("", "The words.")]


class Canvas(NamedTuple):
    """The sheet on which a simulated turtle draws."""

    time: Time
    sheet: Annotated[int, Field("", "Rises whenever the line was wiped off.")]
    background: Annotated[str, Field("", "Colour of the sheet, #rrggbb.")]
    pen: Annotated[str, Field("", "Colour of the pen, #rrggbb.")]
    is_down: Annotated[bool, Field("", "True while the pen leaves a line.")]
    turtles: Annotated[
        tuple[float, ...],
        Field("m, rad", "Number, x, y and heading of each turtle beside the first, in a row."),
    ] = ()


class LogLine(NamedTuple):
    """One event, in words."""

    time: Time
    level: Annotated[LogLevel, Field("", "`debug`, `info`, `warning` or `error`.")]
    source: Annotated[str, Field("", "The block that says it, `robot`, `operator` or `engine`.")]
    text: Annotated[str, Field("", "The words.")]


class Resume(NamedTuple):
    """A person's consent to move again after a latched stop."""

    time: Time


class Setting(NamedTuple):
    """A live parameter of a running block, changed by a person; neither number nor text: none."""

    time: Time
    block: Annotated[str, Field("", "The block's name in the pipeline.")]
    name: Annotated[str, Field("", "The parameter's attribute.")]
    number: Annotated[float | None, Field("see unit", "The value where it is a number.")] = None
    text: Annotated[str | None, Field("", "The value where it is a text.")] = None


class Call(NamedTuple):
    """An action of a running block, or of the simulated robot, called by a person."""

    time: Time
    block: Annotated[str, Field("", "The block's name in the pipeline, or `robot`.")]
    action: Annotated[str, Field("", "The action's name.")]
    arguments: Annotated[tuple[float, ...], Field("SI", "Its arguments in order.")] = ()


Message = (
    Encoders
    | Volts
    | Range
    | Scan
    | Odometry
    | Twist
    | Wheels
    | Duty
    | Goal
    | Path
    | GoalState
    | Stop
    | Link
    | Battery
    | Text
    | Canvas
    | LogLine
    | Resume
    | Setting
    | Call
)

BUILT_IN: dict[str, type] = {kind.__name__: kind for kind in get_args(Message)}


def fields(kind: type) -> dict[str, tuple[Any, Field]]:
    """Each field of a message class: its plain type and its declaration.

    Raises TypeError naming the field when one is not declared with `Annotated[type, Field(...)]`.
    """
    declared: dict[str, tuple[Any, Field]] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        notes = [note for note in get_args(hint)[1:] if isinstance(note, Field)]
        if not notes:
            raise TypeError(f"{kind.__name__}.{name} is not declared with a Field")
        declared[name] = (get_args(hint)[0], notes[0])
    return declared
