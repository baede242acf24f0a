"""Usual mistakes in each lesson: what is changed in its solution, and what the check then finds."""

from typing import NamedTuple


class Wrong(NamedTuple):
    """A change of the text of a file of the solution, and the code of the finding."""

    old: str
    new: str
    code: str


MOVES = (  # of the odometry
    "            self.x += forward * cos(self.heading + turn / 2.0)\n"
    "            self.y += forward * sin(self.heading + turn / 2.0)\n"
)
ONCE = """        if driven < DISTANCE:
            return Twist(pose.time, SPEED, 0.0)
        if not self.stands:
            self.stands = True
            return Twist(pose.time, 0.0, 0.0)
        return None
"""
RIGHT = [  # lesson, text of its solution, and what is as right in its place
    (
        "one_metre",
        "        return Twist(pose.time, SPEED if driven < DISTANCE else 0.0, 0.0)\n",
        f"        self.stands = getattr(self, 'stands', False)\n{ONCE}",
    ),
    (
        "odometry",
        "self.heading += turn\n",
        "self.heading = (self.heading + turn + pi) % (2 * pi) - pi\n",
    ),
]
WRONG = {
    "talker": [
        Wrong("period: 100 ms", "period: 10 ms", "rate"),
        Wrong("period: 100 ms", "period: 95 ms", "rate"),
        Wrong("  listener:", "  # listener:", "error"),
        Wrong("text: talker.text", "text: listener.heard", "error"),
    ],
    "parameters": [
        Wrong("live=True, ", "", "fixed"),
        Wrong("minimum=0.0, maximum=10.0, ", "minimum=0.0, ", "accepted"),
        Wrong("minimum=0.0, maximum=10.0", "above=0.0, below=10.0", "refused"),
        Wrong("        if number is None:", "        if True:", "silent"),
        Wrong("self.factor * number.data", 'float("nan")', "factor"),
    ],
    "turtle_square": [
        Wrong("left = -forward[1], forward[0]", "left = forward[1], -forward[0]", "corners"),
        Wrong("sin(pose.heading)", "0.0 * sin(pose.heading)", "corners"),
        Wrong("self.side * cos", "2.0 * cos", "corners"),
        Wrong("            (pose.x, pose.y),\n", "", "corners"),
    ],
    "one_metre": [
        Wrong(
            "driven = hypot(pose.x - self.start.x, pose.y - self.start.y)", "driven = pose.x", ""
        ),
        Wrong("else 0.0", "else 0.02", ""),
        Wrong("DISTANCE = 1.0", "DISTANCE = 0.9", "distance"),
        Wrong("SPEED if", "-SPEED if", "distance"),
        Wrong(
            "return Twist(pose.time, SPEED if driven < DISTANCE else 0.0, 0.0)",
            "return Twist(pose.time, SPEED, 0.0) if driven < DISTANCE else None",
            "silent",
        ),
        Wrong("SPEED = 0.2", "SPEED = 0.03", "rest"),
    ],
    "counter": [
        Wrong("self.sum += number.data", "self.sum = number.data", "sum"),
        Wrong("self.sum = 0.0", 'self.sum = float("nan")', "sum"),
        Wrong(
            "    def reset(self):\n        self.sum",
            "    sum = 0.0\n\n    def reset(self):\n        x",
            "again",
        ),
        Wrong(
            "    def reset(self):\n        self.sum = 0.0\n",
            "    sums = [0.0]\n\n    @property\n    def sum(self):\n        return self.sums[0]\n\n"
            "    @sum.setter\n    def sum(self, value):\n        self.sums[0] = value\n",
            "shared",
        ),
        Wrong(
            "        self.sum += number.data\n",
            "        while True:\n            pass\n",
            "error",
        ),
    ],
    "counter_cpp": [
        Wrong("sum += number", "sum = number", "sum"),
        Wrong("            sum += number;", "            // sum += number;", "sum"),
        Wrong("double number, sum = 0.0;", "double number, sum;", "error"),
        Wrong('diffbot_is(line, "number")', 'diffbot_is(line, "total")', "silent"),
    ],
    "own_message": [
        Wrong('    state: Literal["open", "closed"]', "    state: str", "type"),
        Wrong(">= 0.2", "> 0.2", "state"),
        Wrong('door.state == "open"', 'door.state == "closed"', "state"),
        Wrong("Door(angle.time, angle.data,", "Door(angle.time, 57.3 * angle.data,", "state"),
        Wrong("door = Out(Door", "gate = Out(Door", "error"),
    ],
    "wiring": [
        Wrong("encoder: {pin: 3}", "encoder: {pin: 19}", "error"),
        Wrong("sensors:\n  front:", "x-sensors:\n  front:", "error"),
        Wrong("include: ./parts.yaml", "include: book_2wd", "robot"),
        Wrong("in1: 9, in2: 10", "in1: 9, in2: 9", "error"),
    ],
    "wheel_speeds": [
        Wrong("(twist.linear - aside)", "(twist.linear + aside)", "speeds"),
        Wrong("self.left_diameter / 2.0", "self.left_diameter", "speeds"),
        Wrong("self.track / 2.0", "0.6 / 2.0", "speeds"),
        Wrong("Wheels(twist.time, left, right)", 'Wheels(twist.time, left, float("nan"))', ""),
        Wrong("Wheels(twist.time, left, right)", "Wheels(twist.time, right, left)", "exchanged"),
    ],
    "odometry": [
        Wrong(
            f"{MOVES}            self.heading += turn\n",
            f"            self.heading += turn\n{MOVES}",
            "position",
        ),
        Wrong("(right - left) / self.track", "(left - right) / self.track", "heading"),
        Wrong("/ self.counts", "/ 64", "heading"),
        Wrong("self.last = encoders\n", "self.last = self.last or encoders\n", "heading"),
    ],
    "scan_stop": [
        Wrong("return Twist(twist.time, 0.0, 0.0)", "return None", "silent"),
        Wrong("abs(aside) < 0.12", "abs(aside) < 0.01", "near"),
        Wrong("cos(bearing) > 0.0 and ahead < 0.35 and abs(aside) < 0.12", "distance < 0.4", "far"),
        Wrong("ahead < 0.35", "0.0 < ahead < 0.35", "zero"),
        Wrong("(scan is None or self.is_blocked(scan))", "scan and self.is_blocked(scan)", "blind"),
    ],
    "calibration": [
        Wrong("(left.x - right.x) / (4.0", "(right.x - left.x) / (4.0", "worse"),
        Wrong("* (pi / 2.0) / (pi / 2.0 - alpha)", "* 1.0", "half"),
        Wrong("left_diameter = 2.0 * DIAMETER / (ratio + 1.0)", "left_diameter = DIAMETER", "mean"),
        Wrong("if abs(beta) > 1e-9:", "if False:", "half"),
    ],
    "why": [
        Wrong('"left" in stop.cause', '"right" in stop.cause', "part"),
        Wrong('startswith("range")', 'startswith("sensor")', "part"),
        Wrong('return Text(now, "obstacle")', "return None", "silent"),
        Wrong('return Text(now, "distance sensor")', 'return Text(now, "obstacle")', "part"),
    ],
}
