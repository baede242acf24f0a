"""Canvas: the colours of the turtle's canvas and pen, and the turtles that do not move."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out, action
from diffbotctl.messages import Canvas, Odometry
from diffbotctl.params import Param

TURTLES_MAX = 100  # limit of one datagram of a screen


class TurtleCanvas(Block):
    """Keep the colours of the canvas and the pen, and the poses of spawned turtles.

    It sends the state of the canvas whenever that changes. The screen draws the line, from the pose
    of the turtle.

    blocks:
      canvas: {block: canvas, in: {odometry: robot.pose}}
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

    odometry = In(Odometry, help="Pose of the turtle, in the frame of the canvas.")
    canvas = Out(Canvas, help="State of the canvas, whenever it changes.")

    def reset(self) -> None:
        self.sheet = 0
        self.turtles: dict[int, tuple[float, float, float]] = {}
        self.number = 1  # the turtle that draws
        self.last_sent: Canvas | None = None

    @action
    def clear(self, now: int) -> None:
        """Erase the line; the turtles stay."""
        self.sheet += 1

    @action(x="m", y="m", heading="rad")
    def spawn(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Add a turtle at x and y in m, heading in rad. Their numbers start at 2."""
        if len(self.turtles) >= TURTLES_MAX:
            raise ValueError(f"there are {TURTLES_MAX} turtles already; kill some")
        self.number += 1
        self.turtles[self.number] = (x, y, heading)

    @action(number="1")
    def kill(self, now: int, number: float) -> None:
        """Remove the turtle with this number."""
        self.turtles.pop(self._turtle(number))

    @action(number="1", x="m", y="m", heading="rad")
    def teleport(
        self, now: int, number: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0
    ) -> None:
        """Move the turtle with this number; `robot.teleport` moves the first one."""
        self.turtles[self._turtle(number)] = (x, y, heading)

    def react(self, now: int, odometry: Odometry | None) -> Canvas | None:
        canvas = Canvas(
            now,
            self.sheet,
            colour(self.background_red, self.background_green, self.background_blue),
            colour(self.pen_red, self.pen_green, self.pen_blue),
            self.pen == "down",
            tuple(
                value for number, pose in self.turtles.items() for value in (float(number), *pose)
            ),
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
