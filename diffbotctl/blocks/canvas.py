"""Canvas: the colours of the turtle's canvas and pen, and the turtles on it."""

from __future__ import annotations

import re
from typing import NamedTuple

from diffbotctl.block import Block, In, Out, action
from diffbotctl.messages import Canvas, Odometry, Pen, Stop, StopCode, TurtlePlacement, Twist
from diffbotctl.params import Param

TURTLES_MAX = 100  # limit of one datagram of a screen
KILLED: StopCode = "turtle_killed"
KILLED_CAUSE = "turtle1 was killed; `diffbotctl call canvas.spawn name=turtle1` brings it back"
FIRST = "turtle1"  # the robot
NUMBERED = re.compile(r"turtle([1-9]\d{0,3})")  # the name that a turtle has without its own
NAME = re.compile(r"[A-Za-z]\w{0,31}", re.ASCII)  # as of a node of ROS
NEW_PEN = Pen("#b3b8ff", 0.07, True)  # as in turtlesim


class SpawnedTurtle(NamedTuple):
    """A further turtle: where it was put (m, rad), and its pen."""

    name: str
    pose: tuple[float, float, float]
    pen: Pen


class TurtleCanvas(Block):
    """Keep the colours of the canvas, the pens, and where turtles were spawned.

    It sends the state of the canvas whenever that changes. The screen draws the lines, from the
    poses of the turtles. A block `turtle` moves the spawned turtle that has its number: turtle2 has
    the number 2, one with a name of its own the highest that is free. Turtle 1 is the robot: its
    pen is set by parameters; its velocity passes through this block, and is zero after it was
    killed.

    blocks:
      canvas: {block: canvas, in: {odometry: robot.pose, twist: limiter.twist}}
    """

    background_red = Param(int, default=69, minimum=0, maximum=255, live=True, help="Canvas: red.")
    background_green = Param(
        int, default=86, minimum=0, maximum=255, live=True, help="Canvas: green."
    )
    background_blue = Param(
        int, default=255, minimum=0, maximum=255, live=True, help="Canvas: blue."
    )
    pen_red = Param(int, default=179, minimum=0, maximum=255, live=True, help="Pen: red.")
    pen_green = Param(int, default=184, minimum=0, maximum=255, live=True, help="Pen: green.")
    pen_blue = Param(int, default=255, minimum=0, maximum=255, live=True, help="Pen: blue.")
    pen = Param(
        str,
        default="down",
        choices=("down", "up"),
        live=True,
        help="down: draw a line; up: draw none.",
    )
    pen_width = Param(
        float, unit="m", default=0.07, above=0.0, maximum=5.0, live=True, help="Width of the line."
    )
    driven = Param(
        int,
        default=1,
        minimum=1,
        help="Highest number of a turtle with a block `turtle`; those above stand still.",
    )
    width = Param(float, unit="m", default=11.09, above=0.0, help="Width of the canvas, along x.")
    height = Param(float, unit="m", default=11.09, above=0.0, help="Height of the canvas, along y.")

    odometry = In(Odometry, help="Pose of the turtle, in the frame of the canvas.")
    twist = In(
        Twist, fresh_for=0.5, optional=True, help="The desired velocity of turtle 1, the robot."
    )
    canvas = Out(Canvas, help="State of the canvas, whenever it changes.")
    passed = Out(Twist, name="twist", help="The same velocity; zero after turtle 1 was killed.")
    stop = Out(Stop, help="That turtle 1 was killed, or is back.")
    placement = Out(TurtlePlacement, help="A turtle that was spawned, moved or killed.")

    def reset(self) -> None:
        self.sheet = 0
        self.turtles: dict[int, SpawnedTurtle] = {}  # by number
        self.placements: tuple[TurtlePlacement, ...] = ()  # not sent yet: one an instant
        self.number = 1  # of the last turtle that was named by its number
        self.has_first = True  # turtle 1, the robot, which draws
        self.reported_first = True
        self.last_twist: Twist | None = None
        self.last_sent: Canvas | None = None

    @action
    def clear(self, now: int) -> None:
        """Erase the line; the turtles stay."""
        self.sheet += 1

    @action
    def start_over(self, now: int) -> None:
        """Erase the line, remove all turtles but the first, and bring that back."""
        self.clear(now)
        self.has_first = True
        for number in list(self.turtles):
            self._remove(number)
        self.number = 1

    @action(x="m", y="m", heading="rad")
    def spawn(
        self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0, name: str = ""
    ) -> str:
        """Add a turtle at x and y in m, heading in rad; returns its name.

        Without a name it gets the next one of turtle2, turtle3 and so on. turtle1: that one again,
        after it was killed.
        """
        if name == FIRST:
            return self._bring_back(x, y, heading)
        self._require_inside(x, y)
        if name in self._names():
            raise ValueError(f"there is a turtle called {name} already; kill it first")
        if len(self.turtles) >= TURTLES_MAX:
            raise ValueError(f"there are {TURTLES_MAX} turtles already; kill some")
        number = self._free_number(name)
        self._place(number, SpawnedTurtle(name or f"turtle{number}", (x, y, heading), NEW_PEN))
        if number > self.driven:
            self.log.warning(f"{self.turtles[number].name} stands still: {self._who_drives()}")
        return self.turtles[number].name

    def _bring_back(self, x: float, y: float, heading: float) -> str:
        if self.has_first:
            raise ValueError("there is a turtle called turtle1 already; kill it first")
        if x or y or heading:
            raise ValueError("turtle1 is where it was killed: `call robot.teleport` moves it")
        self.has_first = True
        return FIRST

    def _free_number(self, name: str) -> int:
        """The number for a new turtle: that in its name, the next one, or for a name of its own
        the highest with a block, so that the low ones stay free."""
        with_block = [n for n in range(2, self.driven + 1) if n not in self.turtles]
        numbered = NUMBERED.fullmatch(name)
        if numbered is not None:
            number = int(numbered[1])
            if number in self.turtles:
                raise ValueError(f"the block {name} moves {self.turtles[number].name}; kill that")
            return number
        if name:
            if NAME.fullmatch(name) is None:
                raise ValueError(f"'{name[:40]}' is no name: use letters, digits and _")
            return max(with_block, default=max(self.driven, 1, *self.turtles) + 1)
        following = self.number + 1
        while following in self.turtles:
            following += 1
        if following > self.driven:
            following = min(with_block, default=following)
        self.number = max(self.number, following)
        return following

    def _who_drives(self) -> str:
        if self.driven == 1:
            return "this pipeline draws spawned turtles; the pipeline `turtles` drives them"
        return f"this pipeline drives turtles 2 to {self.driven}; kill one of these first"

    @action
    def kill(self, now: int, name: str) -> None:
        """Remove the turtle with this name; turtle1 stops."""
        if name == FIRST:
            self._kill_first()
        else:
            self._remove(self._number(name))

    def _remove(self, number: int) -> None:
        self.turtles.pop(number)
        self.placements += (TurtlePlacement(0, number, is_present=False),)

    def _kill_first(self) -> None:
        if "twist" not in self.connected:
            raise ValueError(
                "turtle1 is the robot, and its velocity does not pass through this block: "
                "wire `twist` of the canvas as the pipeline `turtle` does"
            )
        if not self.has_first:
            raise ValueError("turtle1 was killed already")
        self.has_first = False

    @action(x="m", y="m", heading="rad")
    def teleport(
        self, now: int, name: str, x: float = 0.0, y: float = 0.0, heading: float = 0.0
    ) -> None:
        """Move the turtle with this name; `robot.teleport` moves the first one."""
        number = self._number(name, "`call robot.teleport` moves it")
        self._require_inside(x, y)
        self._place(number, self.turtles[number]._replace(pose=(x, y, heading)))

    @action(red="1", green="1", blue="1", width="m")
    def set_pen(
        self,
        now: int,
        name: str,
        red: float = 179,
        green: float = 184,
        blue: float = 255,
        width: float = 0.07,
        pen: str = "down",
    ) -> None:
        """Set colour (0 to 255) and width of the pen of a further turtle; pen is up or down."""
        number = self._number(name, "`param set canvas.pen_red 255` sets its pen")
        parts = [int(part) for part in (red, green, blue)]
        if not all(0 <= part <= 255 for part in parts):
            raise ValueError("red, green and blue are 0 to 255")
        if not 0.0 < width <= 5.0:
            raise ValueError("the width of the pen is above 0 m, and at most 5 m")
        if pen not in ("down", "up"):
            raise ValueError("pen is down or up")
        own = Pen(colour(*parts), width, pen == "down")
        self.turtles[number] = self.turtles[number]._replace(pen=own)

    def _require_inside(self, x: float, y: float) -> None:
        """Raise ValueError for a place outside of the canvas."""
        for axis, place, end in (("x", x, self.width), ("y", y, self.height)):
            if not 0.0 <= place <= end:
                raise ValueError(f"{axis} is 0 to {end:g} m on the canvas; it is {place:g} m")

    def _place(self, number: int, turtle: SpawnedTurtle) -> None:
        self.turtles[number] = turtle
        self.placements += (TurtlePlacement(0, number, *turtle.pose),)

    def react(
        self, now: int, odometry: Odometry | None, twist: Twist | None
    ) -> tuple[Canvas | None, Twist | None, Stop | None, TurtlePlacement | None]:
        placement = None
        if self.placements:
            placement = self.placements[0]._replace(time=now)
            self.placements = self.placements[1:]
        return self._canvas(now), self._passed(now, twist), self._stop_event(now), placement

    def _passed(self, now: int, twist: Twist | None) -> Twist | None:
        """The velocity for the robot when it is new, or zero without turtle 1."""
        if twist is None or twist is self.last_twist:
            return None
        self.last_twist = twist
        return twist if self.has_first else Twist(now, 0.0, 0.0)

    def _stop_event(self, now: int) -> Stop | None:
        if self.has_first == self.reported_first:
            return None
        self.reported_first = self.has_first
        code, cause = ("", "") if self.has_first else (KILLED, KILLED_CAUSE)
        return Stop(now, code, cause, False)

    def _canvas(self, now: int) -> Canvas | None:
        """The state of the canvas; None if it has not changed."""
        canvas = Canvas(
            now,
            self.sheet,
            colour(self.background_red, self.background_green, self.background_blue),
            colour(self.pen_red, self.pen_green, self.pen_blue),
            self.pen == "down",
            tuple(
                value
                for number, turtle in self.turtles.items()
                for value in (float(number), *turtle.pose)
            ),
            self.pen_width,
            self.has_first,
            tuple(turtle.name for turtle in self.turtles.values()),
            tuple(turtle.pen for turtle in self.turtles.values()),
        )
        if self.last_sent is not None and canvas[1:] == self.last_sent[1:]:
            return None
        self.last_sent = canvas
        return canvas

    def _names(self) -> dict[str, int]:
        """The number of each further turtle, by its name."""
        return {turtle.name: number for number, turtle in self.turtles.items()}

    def _number(self, name: str, of_first: str = "") -> int:
        """The number of the further turtle `name`. Raises ValueError; `of_first`: for turtle1."""
        if name == FIRST:
            raise ValueError(f"turtle1 is the robot itself: {of_first}")
        names = self._names()
        if name not in names:
            others = ", ".join(names) or "none but turtle1"
            raise ValueError(f"there is no turtle called '{name[:40]}'; there is {others}")
        return names[name]


def colour(red: int, green: int, blue: int) -> str:
    """The colour as `#rrggbb`."""
    return f"#{red:02x}{green:02x}{blue:02x}"
