"""What was driven by keys, from a recording."""

from math import degrees, hypot, pi

REST = 1_000_000_000  # ns; the end of a run stops the turtle, and then lasts for less


def judged(messages):
    """`passed`, or a finding, of the messages of a recording."""
    last = twist = None
    path, turned, moved = 0.0, [0.0, 0.0], 0
    for recorded in messages:
        if recorded.wire == "operator.twist":
            twist = recorded.message
        if recorded.wire != "robot.pose":
            continue
        pose = recorded.message
        if last is not None:
            way, turn = hypot(pose.x - last.x, pose.y - last.y), pose.heading - last.heading
            path += way
            turned[turn < 0.0] += abs(turn)
            moved = pose.time if way + abs(turn) > 1e-4 else moved
        last = pose
    if last is None:
        return "other: it has no pose of a turtle"
    if twist is None:
        return "hands: nothing was driven by keys"
    if path < 3.0:
        return f"path: {path:.1f} m"
    if min(turned) < pi:
        return (
            f"turn: {degrees(turned[0]):.0f} deg to the left, {degrees(turned[1]):.0f} to the right"
        )
    if (twist.linear or twist.angular) and last.time - moved < REST:
        return "rest: the turtle moves at the end"
    return "passed"
