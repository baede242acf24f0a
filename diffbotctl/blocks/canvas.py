"""Canvas: the colours of the turtle's canvas and pen, and the turtles on it."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out, action
from diffbotctl.messages import Canvas, Odometry, Stop, StopCode, TurtlePlacement, Twist
from diffbotctl.params import Param

TURTLES_MAX = 100  # limit of one datagram of a screen
KILLED: StopCode = "turtle_killed"
KILLED_CAUSE = "turtle 1 was killed; `diffbotctl call canvas.spawn number=1` brings it back"


class TurtleCanvas(Block):
    """Keep the colours of the canvas and the pen, and where turtles were spawned.

    It sends the state of the canvas whenever that changes. The screen draws the line, from the pose
    of the turtle. A block `turtle` moves the spawned turtle that has its number. Turtle 1 is the
    robot: its velocity passes through this block, and is zero after it was killed.

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
        self.turtles: dict[int, tuple[float, float, float]] = {}
        self.placements: tuple[TurtlePlacement, ...] = ()  # not sent yet: one an instant
        self.number = 1  # the highest one that there was
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
            self.kill(now, number)

    @action(x="m", y="m", heading="rad", number="1")
    def spawn(
        self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0, number: float = 0.0
    ) -> int:
        """Add a turtle at x and y in m, heading in rad; returns its number.

        The numbers start at 2; 0: the next one; 1: turtle 1 again, after it was killed.
        """
        if number == 1:
            return self._bring_back(x, y, heading)
        if len(self.turtles) >= TURTLES_MAX:
            raise ValueError(f"there are {TURTLES_MAX} turtles already; kill some")
        if number and (number < 2 or number != int(number)):
            raise ValueError(f"{number:g} is no number of a further turtle: they start at 2")
        if number in self.turtles:
            raise ValueError(f"there is a turtle {number:g} already; kill it first")
        given = int(number) or self._next_number()
        self.number = max(self.number, given)
        self._place(given, (x, y, heading))
        if given > self.driven:
            self.log.warning(f"turtle {given} stands still: {self._who_drives()}")
        return given

    def _bring_back(self, x: float, y: float, heading: float) -> int:
        if self.has_first:
            raise ValueError("there is a turtle 1 already; kill it first")
        if x or y or heading:
            raise ValueError("turtle 1 is where it was killed: `call robot.teleport` moves it")
        self.has_first = True
        return 1

    def _next_number(self) -> int:
        """The next number; when those that can be driven are used up, the first free one."""
        free = (n for n in range(2, self.driven + 1) if n not in self.turtles)
        following = self.number + 1
        return following if following <= self.driven else next(free, following)

    def _who_drives(self) -> str:
        if self.driven == 1:
            return "this pipeline draws spawned turtles; the pipeline `turtles` drives them"
        return f"this pipeline drives turtles 2 to {self.driven}; kill one of these first"

    @action(number="1")
    def kill(self, now: int, number: float) -> None:
        """Remove the turtle with this number; turtle 1 stops."""
        if number == 1:
            self._kill_first()
            return
        removed = self._turtle(number)
        self.turtles.pop(removed)
        self.placements += (TurtlePlacement(0, removed, is_present=False),)

    def _kill_first(self) -> None:
        if "twist" not in self.connected:
            raise ValueError(
                "turtle 1 is the robot, and its velocity does not pass through this block: "
                "wire `twist` of the canvas as the pipeline `turtle` does"
            )
        if not self.has_first:
            raise ValueError("turtle 1 was killed already")
        self.has_first = False

    @action(number="1", x="m", y="m", heading="rad")
    def teleport(
        self, now: int, number: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0
    ) -> None:
        """Move the turtle with this number; `robot.teleport` moves the first one."""
        self._place(self._turtle(number), (x, y, heading))

    def _place(self, number: int, pose: tuple[float, float, float]) -> None:
        self.turtles[number] = pose
        self.placements += (TurtlePlacement(0, number, *pose),)

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
                value for number, pose in self.turtles.items() for value in (float(number), *pose)
            ),
            self.pen_width,
            self.has_first,
        )
        if self.last_sent is not None and canvas[1:] == self.last_sent[1:]:
            return None
        self.last_sent = canvas
        return canvas

    def _turtle(self, number: float) -> int:
        if number == 1:
            raise ValueError("turtle 1 is the robot itself: `call robot.teleport` moves it")
        if number not in self.turtles:
            numbers = ", ".join(map(str, self.turtles)) or "none but 1"
            raise ValueError(f"there is no turtle {number:g}; there is {numbers}")
        return int(number)


def colour(red: int, green: int, blue: int) -> str:
    """The colour as `#rrggbb`."""
    return f"#{red:02x}{green:02x}{blue:02x}"
