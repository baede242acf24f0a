"""The messages on the wires: typed, immutable, in SI units and right-handed frames.

x points forward, y left, headings turn counter-clockwise (REP-103); poses are in the frame `odom`,
velocities in `base_link` (REP-105). The first field of each message is `time`: the logical time in
integer nanoseconds at which its content was true. Each field is declared here with its unit and a
sentence; schemas, recordings and reference pages are derived from these declarations.
"""

# No postponed annotations: NamedTuple would compile each of them again at every start, 2 ms.
from math import inf
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints


class Field(NamedTuple):
    """Description of a message field: its SI unit ("" if it has none) and one sentence.

    `minimum`, `maximum`: bounds (inclusive) of a number, or of each number of a tuple.
    """

    unit: str
    help: str = ""
    minimum: float = -inf
    maximum: float = inf


UNDESCRIBED = Field("", "")  # of a field that is declared by its type alone

CommandKind = Literal["wheels", "duty"]
RangeState = Literal["clear", "measured", "too_close", "fault"]
ImuState = Literal["zeroing", "working", "failed"]
GoalPhase = Literal["idle", "turning", "driving", "aligning"]
GoalEnd = Literal["reached", "reached_unsure", "blocked", "stuck", "given_up", "cancelled"]
"""How a goal ends.

- reached: within both tolerances.
- reached_unsure: within the tolerances, but the pose is known less well than they ask for.
- blocked: a stop held the robot for longer than it waits.
- stuck: no wheel turned while it should have driven.
- given_up: not reached within the attempts or the time.
- cancelled: the operator has replaced it by another goal.
"""
REACHED_UNSURE = 3
GOAL_EXIT_CODES: dict[GoalPhase | GoalEnd, int] = {
    "reached": 0,
    "reached_unsure": REACHED_UNSURE,
    "blocked": 1,
    "stuck": 1,
    "given_up": 1,
    "cancelled": 1,
}
"""Exit code of a run that ends with its goal; a run that is interrupted exits with 130."""
MapPhase = Literal["starting", "mapping", "localised", "searching", "ambiguous", "lost", "odometry"]
MapTask = Literal["save", "load", "clear", "place"]
LinkState = Literal["opening", "negotiating", "up", "stale", "lost"]
LogLevel = Literal["debug", "info", "warning", "error"]
LOG_LEVELS: tuple[LogLevel, ...] = get_args(LogLevel)  # in order of severity
# Codes of the stops of this package. Blocks of other packages may have codes of their own, so
# Stop.code is a str.
StopCode = Literal[
    "",
    "operator_stop",
    "operator_lost",
    "obstacle",
    "too_close",
    "range_fault",
    "range_stale",
    "scan_stale",
    "scan_blind",
    "telemetry_stale",
    "link_lost",
    "commands_lost",
    "reconnect",
    "board_restart",
    "command_stale",
    "gate_limit",
    "host_frozen",
    "block_overrun",
    "wheel_runaway",
    "wheel_direction",
    "wheel_fault",
    "battery_low",
    "stop_button",
    "overruled",
    "turtle_killed",
    "input_stale",
    "source_starting",
]

# A source on which the motion depends has sent nothing since it was opened: the robot waits.
STARTING: StopCode = "source_starting"

Time = Annotated[int, Field("ns", "Logical time at which the content was true.")]
Metres = Annotated[float, Field("m", "A length.")]
PoseCovariance = tuple[float, float, float, float, float, float]
"""Upper triangle of the covariance of (x, y, heading): xx xy xh yy yh hh."""


class Encoders(NamedTuple):
    """Counts of both wheels at one time, with the commands in force at that time.

    Counts are unwrapped, and signed by the direction that the board assumes. `boot` changes when
    the board restarts: counts then start again, and differences across the change are invalid.
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
    command_time: Annotated[int | None, Field("ns", "When that command took effect, if known.")] = (
        None
    )
    boot: Annotated[int, Field("", "Changes each time the board restarts.")] = 0
    skipped_left_command: Annotated[
        float, Field("see kind", "Left command that was replaced before a frame showed it.")
    ] = 0.0
    skipped_right_command: Annotated[float, Field("see kind", "The same, right.")] = 0.0
    skipped_command_time: Annotated[
        int | None, Field("ns", "When that command took effect; none when none was skipped.")
    ] = None
    turn: Annotated[
        float | None,
        Field("rad", "Sum of the gyro's rate since the start, uncorrected; none without a gyro."),
    ] = None
    turn_fault: Annotated[str, Field("", "Why the turn is wrong; empty when it is not.")] = ""
    left_level: Annotated[
        int | None,
        Field("", "Level of the left encoder's pin, 0 or 1; none if not sent."),
    ] = None
    right_level: Annotated[int | None, Field("", "The same, right.")] = None
    left_duty: Annotated[
        float | None, Field("", "Duty of the left motor, -1 to 1; none where it is not reported.")
    ] = None
    right_duty: Annotated[float | None, Field("", "The same, right.")] = None


class Volts(NamedTuple):
    """A raw sensor voltage; `nan` when the board reported a fault."""

    time: Time
    volts: Annotated[float, Field("V", "Voltage at the board's pin.")]


class Range(NamedTuple):
    """One distance along a sensor's axis."""

    time: Time
    distance: Annotated[
        float, Field("m", "Distance; the maximum range when clear, 0 when too close.")
    ]
    state: Annotated[RangeState, Field("", "`clear`, `measured`, `too_close` or `fault`.")]


class Scan(NamedTuple):
    """Distances at equally spaced bearings, in the sensor's frame, in the order of measurement."""

    time: Time
    start: Annotated[float, Field("rad", "Bearing of the first ray.")]
    step: Annotated[float, Field("rad", "From a ray to the next one; negative: clockwise.")]
    distances: Annotated[
        tuple[float, ...], Field("m", "One for each ray: inf when clear, 0 when too close.")
    ]
    duration: Annotated[
        float,
        Field(
            "s",
            "Of the whole turn, at whose end `time` is: of n rays, ray i was measured "
            "(1 - i / n) * duration before. 0: all at once.",
        ),
    ] = 0.0


class Odometry(NamedTuple):
    """Pose of base_link in odom, and velocity in base_link."""

    time: Time
    x: Annotated[float, Field("m", "Position forward of the start.")]
    y: Annotated[float, Field("m", "Position left of the start.")]
    heading: Annotated[float, Field("rad", "Heading, unwrapped.")]
    linear: Annotated[float, Field("m/s", "Forward speed.")]
    angular: Annotated[float, Field("rad/s", "Turn rate.")]
    covariance: Annotated[
        PoseCovariance,
        Field("m, rad", "Upper triangle of the covariance of (x, y, heading): xx xy xh yy yh hh."),
    ]
    warning: Annotated[
        str, Field("", "Why the pose is less accurate than usual; empty when it is not.")
    ] = ""
    geometry_sd: Annotated[
        float,
        Field(
            "m",
            "Part of the position's standard deviation, in its worst direction, that comes from "
            "how well track and wheel diameters are known.",
        ),
    ] = 0.0
    geometry_heading_sd: Annotated[
        float,
        Field(
            "rad",
            "The same part of the heading's standard deviation, with that of a gyro's scale that "
            "is not calibrated.",
        ),
    ] = 0.0
    coast_time: Annotated[
        float,
        Field(
            "s",
            "Released now, the wheels travel this time their speed until they rest; 0: not known.",
        ),
    ] = 0.0
    lost_edges_probability: Annotated[
        float,
        Field("", "Probability that an encoder loses every second edge, or counts each one twice."),
    ] = 0.0
    pushed_heading_sd: Annotated[
        float,
        Field("rad", "Standard deviation of the heading by wheels that turned without a command."),
    ] = 0.0


class Imu(NamedTuple):
    """What the gyro of an IMU measures, and whether the heading comes from it."""

    time: Time
    state: Annotated[
        ImuState,
        Field(
            "",
            "`zeroing`: not used before its bias was measured at rest; `working`; `failed`.",
        ),
    ]
    rate: Annotated[float, Field("rad/s", "Turn rate without the bias; 0 unless it works.")] = 0.0
    bias: Annotated[float, Field("rad/s", "Rate that it measures at rest.")] = 0.0
    bias_sd: Annotated[float, Field("rad/s", "Standard deviation of the bias.")] = 0.0
    calibrated: Annotated[bool, Field("", "True when its scale was calibrated.")] = False
    cause: Annotated[str, Field("", "Why it has failed.")] = ""


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
    """Desired motor duty, for boards without a speed loop; positive drives forward."""

    time: Time
    left: Annotated[float, Field("1", "Left motor, -1 to 1.")]
    right: Annotated[float, Field("1", "Right motor, -1 to 1.")]


class Goal(NamedTuple):
    """A pose to reach, in odom. `number` identifies the goal; 0 cancels the current one."""

    time: Time
    number: Annotated[int, Field("", "Increases with every goal; 0 means no goal.")]
    x: Annotated[float, Field("m", "Position along x.")] = 0.0
    y: Annotated[float, Field("m", "Position along y.")] = 0.0
    heading: Annotated[float | None, Field("rad", "Final heading, or none.")] = None


class Path(NamedTuple):
    """All waypoints in one message, in order."""

    time: Time
    goals: Annotated[
        tuple[Goal, ...], Field("", "Waypoints, in the order in which they are visited.")
    ]


class GoalState(NamedTuple):
    """Progress of the current goal."""

    time: Time
    number: Annotated[int, Field("", "Number of the goal.")]
    state: Annotated[
        Literal[GoalPhase, GoalEnd],
        Field(
            "",
            "`idle`, `turning`, `driving`, `aligning`, or how the goal ended: `reached`, "
            "`reached_unsure`, `blocked`, `stuck`, `given_up`, `cancelled`.",
        ),
    ]
    distance: Annotated[float, Field("m", "Remaining distance to the goal.")]
    turn: Annotated[float, Field("rad", "Remaining heading error.")]
    cause: Annotated[str, Field("", "Why the goal was not reached.")] = ""


class Stop(NamedTuple):
    """The robot is stopped, or released again when `code` is empty."""

    time: Time
    code: Annotated[str, Field("", "The rule that stopped the robot; empty when it may move.")]
    cause: Annotated[str, Field("", "Why the robot is stopped.")]
    latched: Annotated[bool, Field("", "True when only `resume` ends the stop.")]


class Link(NamedTuple):
    """State of the link to the board."""

    time: Time
    state: Annotated[LinkState, Field("", "`opening`, `negotiating`, `up`, `stale` or `lost`.")]
    received: Annotated[int, Field("", "Valid frames received since the start.")] = 0
    damaged: Annotated[int, Field("", "Damaged frames or bytes, which were discarded.")] = 0
    lost: Annotated[int, Field("", "Frames missing in the sequence.")] = 0
    restarts: Annotated[int, Field("", "Number of restarts of the board.")] = 0
    latency: Annotated[float, Field("s", "Latest time from command to echo; nan if unknown.")] = (
        float("nan")
    )
    cause: Annotated[str, Field("", "Why the link is not up.")] = ""


class Battery(NamedTuple):
    """The motor supply."""

    time: Time
    volts: Annotated[float, Field("V", "Supply voltage.")]
    low: Annotated[bool, Field("", "True below the low limit of the robot file.")] = False


class Text(NamedTuple):
    """A text, as std_msgs/String."""

    time: Time
    text: Annotated[str, Field("", "The text.")]


class Pen(NamedTuple):
    """The pen of a turtle."""

    colour: Annotated[str, Field("", "#rrggbb.")]
    width: Annotated[float, Field("m", "Width of the line.")]
    is_down: Annotated[bool, Field("", "True while it draws.")]


class Canvas(NamedTuple):
    """The canvas on which a simulated turtle draws."""

    time: Time
    sheet: Annotated[int, Field("", "Increases each time the drawing is cleared.")]
    background: Annotated[str, Field("", "Background colour, #rrggbb.")]
    pen: Annotated[str, Field("", "Colour of the pen of turtle 1, #rrggbb.")]
    is_down: Annotated[bool, Field("", "True while that pen draws.")]
    turtles: Annotated[
        tuple[float, ...],
        Field("m, rad", "Number, x, y and heading of each further turtle, concatenated."),
    ] = ()
    pen_width: Annotated[float, Field("m", "Width of the line.")] = 0.07
    has_first: Annotated[bool, Field("", "False after turtle 1 was killed.")] = True
    names: Annotated[tuple[str, ...], Field("", "Name of each further turtle.")] = ()
    pens: Annotated[tuple[Pen, ...], Field("", "Pen of each further turtle.")] = ()


class Color(NamedTuple):
    """What the colour sensor of a turtle sees below it."""

    time: Time
    red: Annotated[int, Field("", "0 to 255.")]
    green: Annotated[int, Field("", "0 to 255.")]
    blue: Annotated[int, Field("", "0 to 255.")]


class TurtlePlacement(NamedTuple):
    """A further turtle was put on the canvas, moved, or removed."""

    time: Time
    number: Annotated[int, Field("", "Number of the turtle; 1 is the robot itself.")]
    x: Annotated[float, Field("m", "Position in the frame of the canvas.")] = 0.0
    y: Annotated[float, Field("m", "Position in the frame of the canvas.")] = 0.0
    heading: Annotated[float, Field("rad", "Heading, counter-clockwise from x.")] = 0.0
    is_present: Annotated[bool, Field("", "False when it was removed.")] = True


class TurtleGoal(NamedTuple):
    """Where a further turtle has to go."""

    time: Time
    x: Annotated[float, Field("m", "Position in the frame of the canvas.")]
    y: Annotated[float, Field("m", "Position in the frame of the canvas.")]


class TurtlePose(NamedTuple):
    """Pose and velocity of a further turtle."""

    time: Time
    number: Annotated[int, Field("", "Number of the turtle; 1 is the robot itself.")]
    x: Annotated[float, Field("m", "Position in the frame of the canvas.")]
    y: Annotated[float, Field("m", "Position in the frame of the canvas.")]
    heading: Annotated[float, Field("rad", "Heading, counter-clockwise from x, -pi to pi.")]
    linear: Annotated[float, Field("m/s", "Forward speed.")]
    angular: Annotated[float, Field("rad/s", "Turn rate.")]


class Scalar(NamedTuple):
    """One value: what the types of std_msgs of ROS share; their String is the class Text.

    They derive from one NamedTuple because each further one takes 0.25 ms at every start.
    """

    time: Time
    data: float  # or a narrower type


class Bool(Scalar):
    """A truth value, as std_msgs/Bool."""

    __slots__ = ()
    data: Annotated[bool, Field("", "The value.")]


class Int8(Scalar):
    """A whole number of 8 bits, as std_msgs/Int8."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", -(2**7), 2**7 - 1)]


class Int16(Scalar):
    """A whole number of 16 bits, as std_msgs/Int16."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", -(2**15), 2**15 - 1)]


class Int32(Scalar):
    """A whole number of 32 bits, as std_msgs/Int32."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", -(2**31), 2**31 - 1)]


class Int64(Scalar):
    """A whole number of 64 bits, as std_msgs/Int64."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", -(2**63), 2**63 - 1)]


class UInt8(Scalar):
    """A whole number of 0 or more, of 8 bits, as std_msgs/UInt8."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", 0, 2**8 - 1)]


class UInt16(Scalar):
    """A whole number of 0 or more, of 16 bits, as std_msgs/UInt16."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", 0, 2**16 - 1)]


class UInt32(Scalar):
    """A whole number of 0 or more, of 32 bits, as std_msgs/UInt32."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", 0, 2**32 - 1)]


class UInt64(Scalar):
    """A whole number from 0 to 2^63 - 1, as std_msgs/UInt64."""

    __slots__ = ()
    data: Annotated[int, Field("", "The number.", 0, 2**63 - 1)]


class Float32(Scalar):
    """A number of 32 bits, as std_msgs/Float32."""

    __slots__ = ()
    data: Annotated[float, Field("", "The number.")]


class Float64(Scalar):
    """A number of 64 bits, as std_msgs/Float64."""

    __slots__ = ()
    data: Annotated[float, Field("", "The number.")]


class Empty(NamedTuple):
    """An event without a value, as std_msgs/Empty."""

    time: Time


class ScanPoints(NamedTuple):
    """A scan as points of the robot, corrected for its motion during the turn of the lidar."""

    time: Time
    x: Annotated[float, Field("m", "Position of base_link in odom at `time`.")]
    y: Annotated[float, Field("m", "The same.")]
    heading: Annotated[float, Field("rad", "Its heading in odom.")]
    covariance: Annotated[
        PoseCovariance,
        Field("m, rad", "Of that pose, as in Odometry."),
    ]
    origin: Annotated[tuple[float, float], Field("m", "The lidar in base_link.")]
    points: Annotated[
        tuple[float, ...],
        Field("m", "x, y in base_link at `time` of what each ray met, concatenated."),
    ]
    clear: Annotated[
        tuple[float, ...], Field("m", "The same of how far the rays went that met nothing.")
    ] = ()


class MapRequest(NamedTuple):
    """What the map is asked to do. `number` identifies the request."""

    time: Time
    number: Annotated[int, Field("", "Increases with every request.")]
    task: Annotated[MapTask, Field("", "`save`, `load`, `clear` or `place`.")]
    name: Annotated[str, Field("", "Name of the map to save or load.")] = ""
    x: Annotated[float, Field("m", "Where the robot is in the map, for `place`.")] = 0.0
    y: Annotated[float, Field("m", "The same.")] = 0.0
    heading: Annotated[float, Field("rad", "The same.")] = 0.0
    heading_sd: Annotated[float, Field("rad", "Its standard deviation; pi: not known.")] = 0.2


class MapUpdate(NamedTuple):
    """The pose of odom in the map, and what has changed in the map.

    The map consists of tiles of 64 x 64 cells. A tile is a text of runs, such as `60u3.1#`, row
    after row from the lowest y on: u unknown, . free, # occupied.
    """

    time: Annotated[int, Field("ns", "Of the scan from which the pose is.")]
    state: Annotated[
        MapPhase,
        Field(
            "",
            "`mapping`: the map grows; `localised`: the place in a loaded map is known; "
            "`searching`: it is not yet; `ambiguous`: several places fit, see `candidates`; "
            "`lost`: what the lidar measures does not fit the map; `starting`: no scan yet.",
        ),
    ]
    x: Annotated[float, Field("m", "Origin of odom in the map.")] = 0.0
    y: Annotated[float, Field("m", "The same.")] = 0.0
    heading: Annotated[float, Field("rad", "Direction of odom in the map.")] = 0.0
    covariance: Annotated[
        PoseCovariance,
        Field("m, rad", "Of the robot's pose in the map at `time`, as in Odometry."),
    ] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    candidates: Annotated[
        tuple[float, ...], Field("m, rad", "x, y and heading of each possible pose, concatenated.")
    ] = ()
    map: Annotated[int, Field("", "Changes when all tiles are sent anew, for another map.")] = 0
    version: Annotated[int, Field("", "Increases with each change of the map.")] = 0
    sha256: Annotated[str, Field("", "Of all tiles; empty while some are still to come.")] = ""
    resolution: Annotated[float, Field("m", "Side of a cell.")] = 0.05
    places: Annotated[
        tuple[int, ...],
        Field("", "Column and row of each tile, concatenated; cell 0, 0 begins at the origin."),
    ] = ()
    tiles: Annotated[tuple[str, ...], Field("", "The tiles that have changed.")] = ()
    request: Annotated[int, Field("", "Number of the last request; 0: none yet.")] = 0
    refusal: Annotated[str, Field("", "Why that request failed; empty when it did not.")] = ""
    cause: Annotated[str, Field("", "Why it is in this state.")] = ""


class MapPose(NamedTuple):
    """The robot in the map: the pose of odom in the map, and with the odometry since then."""

    time: Time
    x: Annotated[float, Field("m", "Position of base_link in the map.")]
    y: Annotated[float, Field("m", "The same.")]
    heading: Annotated[float, Field("rad", "Its heading in the map.")]
    covariance: Annotated[
        PoseCovariance,
        Field("m, rad", "Upper triangle of the covariance of (x, y, heading), as in Odometry."),
    ]
    state: Annotated[MapPhase, Field("", "As in MapUpdate; `odometry`: no new answers come.")]
    odom: Annotated[
        tuple[float, float, float], Field("m, rad", "x, y and heading of odom in the map.")
    ] = (0.0, 0.0, 0.0)
    cause: Annotated[str, Field("", "Why it is in this state.")] = ""


class LogLine(NamedTuple):
    """One event in the log."""

    time: Time
    level: Annotated[LogLevel, Field("", "`debug`, `info`, `warning` or `error`.")]
    source: Annotated[str, Field("", "The block that logged it, `robot`, `operator` or `engine`.")]
    text: Annotated[str, Field("", "The text.")]


class Resume(NamedTuple):
    """Permission to move again after a latched stop."""

    time: Time


class Setting(NamedTuple):
    """A change of a live parameter of a running block; neither number nor text means none."""

    time: Time
    block: Annotated[str, Field("", "Name of the block in the pipeline.")]
    name: Annotated[str, Field("", "Name of the parameter.")]
    number: Annotated[float | None, Field("see unit", "The value, if it is a number.")] = None
    text: Annotated[str | None, Field("", "The value, if it is a text.")] = None


class Call(NamedTuple):
    """A call of an action of a running block or of the simulated robot."""

    time: Time
    block: Annotated[str, Field("", "Name of the block in the pipeline, or `robot`.")]
    action: Annotated[str, Field("", "Name of the action.")]
    arguments: Annotated[
        tuple[float, ...], Field("SI", "Arguments that are numbers, in order.")
    ] = ()
    texts: Annotated[tuple[str, ...], Field("", "Arguments that are texts, in order.")] = ()


Message = (
    Encoders
    | Volts
    | Range
    | Scan
    | Odometry
    | Imu
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
    | Bool
    | Int8
    | Int16
    | Int32
    | Int64
    | UInt8
    | UInt16
    | UInt32
    | UInt64
    | Float32
    | Float64
    | Empty
    | Canvas
    | Color
    | TurtlePlacement
    | TurtleGoal
    | TurtlePose
    | ScanPoints
    | MapRequest
    | MapUpdate
    | MapPose
    | LogLine
    | Resume
    | Setting
    | Call
)

# Messages whose numbers are finite; others use `nan` or `inf` for a fault or a clear view.
FINITE = (
    Twist,
    Wheels,
    Duty,
    Odometry,
    Imu,
    Goal,
    Battery,
    TurtlePlacement,
    TurtleGoal,
    TurtlePose,
    ScanPoints,
    MapPose,
)
BUILT_IN: dict[str, type] = {kind.__name__: kind for kind in get_args(Message)}
STD_MSGS: dict[str, type] = {  # of ROS, with one value or none
    kind.__name__: kind
    for kind in (
        Bool,
        Int8,
        Int16,
        Int32,
        Int64,
        UInt8,
        UInt16,
        UInt32,
        UInt64,
        Float32,
        Float64,
        Empty,
    )
} | {"String": Text}


def fields(kind: type) -> dict[str, tuple[Any, Field]]:
    """The fields of a message class: plain type and declaration of each.

    A field that is declared without `Annotated[type, Field(...)]` has neither unit nor help.
    """
    declared: dict[str, tuple[Any, Field]] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        notes: list[Any] = []
        if get_origin(hint) is Annotated:
            hint, *notes = get_args(hint)
        if any(map(_has_notes, get_args(hint))):
            hint = get_type_hints(kind)[name]  # without the notes, also within tuples and unions
        field = next((note for note in notes if isinstance(note, Field)), UNDESCRIBED)
        declared[name] = (hint, field)
    return declared


def _has_notes(hint: Any) -> bool:
    return get_origin(hint) is Annotated or any(map(_has_notes, get_args(hint)))
