"""What was driven by keys, from a recording."""

from math import degrees, hypot, pi


def judged(messages):
    """`passed`, or a finding, of the messages of a recording."""
    last, path, turned, driven = None, 0.0, [0.0, 0.0], 0
    twist = None
    for recorded in messages:
        if recorded.wire == "operator.twist":
            driven += 1
            twist = recorded.message
        if recorded.wire != "robot.pose":
            continue
        pose = recorded.message
        if last is not None:
            path += hypot(pose.x - last.x, pose.y - last.y)
            turn = pose.heading - last.heading
            turned[turn < 0.0] += abs(turn)
        last = pose
    if last is None:
        return "other: it has no pose of a turtle"
    if not driven:
        return "hands: nothing was driven by keys"
    if path < 3.0:
        return f"path: {path:.1f} m"
    if min(turned) < pi:
        return (
            f"turn: {degrees(turned[0]):.0f} deg to the left, {degrees(turned[1]):.0f} to the right"
        )
    if hypot(last.linear, last.angular) > 0.01 or (twist and twist.linear):
        return "rest: the turtle moves at the end"
    return "passed"
