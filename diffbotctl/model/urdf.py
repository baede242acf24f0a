"""Export of a robot as URDF, the model format of ROS, for drawing and simulation.

Format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from math import pi
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from diffbotctl.config.robot import Robot
from diffbotctl.model.frames import (
    WORLD,
    Box,
    Cylinder,
    RobotFrame,
    Solid,
    Sphere,
    robot_frames,
    robot_solids,
)

COLOURS = {
    "blue": (0.2, 0.4, 0.8, 1.0),
    "black": (0.1, 0.1, 0.1, 1.0),
    "grey": (0.7, 0.7, 0.7, 1.0),
    "red": (0.8, 0.2, 0.2, 1.0),
}


def urdf(robot: Robot, name: str) -> str:
    """The robot `name` as URDF text, with the root base_footprint."""
    root = Element("robot", name=name)
    for colour, values in COLOURS.items():
        SubElement(SubElement(root, "material", name=colour), "color", rgba=numbers(*values))
    bodies = {solid.frame: solid for solid in robot_solids(robot)}
    tree = list(robot_frames(robot))
    for frame in tree:
        _link(root, frame.name, bodies.get(frame.name))
    for frame in tree:
        if frame.parent != WORLD:  # the pose of the robot is not part of its model
            _joint(root, frame)
    indent(root)
    return (
        '<?xml version="1.0"?>\n<!-- diffbotctl -->\n' + tostring(root, encoding="unicode") + "\n"
    )


def numbers(*values: float) -> str:
    """Numbers in URDF notation, with twelve significant digits."""
    return " ".join(f"{value:.12g}" for value in values)


def _link(root: Element, name: str, solid: Solid | None) -> None:
    link = SubElement(root, "link", name=name)
    if solid is None:
        return
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=numbers(*solid.at), rpy=numbers(0, 0, 0))
    SubElement(inertial, "mass", value=numbers(solid.mass))
    x, y, z = solid.shape.moments(solid.mass)
    about = {"ixx": x, "ixy": 0.0, "ixz": 0.0, "iyy": y, "iyz": 0.0, "izz": z}
    SubElement(inertial, "inertia", {axis: numbers(value) for axis, value in about.items()})
    for use in ("visual", "collision"):
        part = SubElement(link, use)
        # The axis of a URDF cylinder is z; ours is y.
        roll = 0.5 * pi if isinstance(solid.shape, Cylinder) else 0.0
        SubElement(part, "origin", xyz=numbers(*solid.at), rpy=numbers(roll, 0, 0))
        _shape(SubElement(part, "geometry"), solid.shape)
        if use == "visual":
            SubElement(part, "material", name=solid.colour)


def _shape(geometry: Element, shape: Box | Cylinder | Sphere) -> None:
    match shape:
        case Box(size):
            SubElement(geometry, "box", size=numbers(*size))
        case Cylinder(radius, length):
            SubElement(geometry, "cylinder", radius=numbers(radius), length=numbers(length))
        case Sphere(radius):
            SubElement(geometry, "sphere", radius=numbers(radius))


def _joint(root: Element, frame: RobotFrame) -> None:
    is_wheel = frame.moves == "wheel"
    kind = "continuous" if is_wheel else "fixed"
    joint = SubElement(root, "joint", name=f"{frame.name.removesuffix('_link')}_joint", type=kind)
    SubElement(joint, "parent", link=frame.parent)
    SubElement(joint, "child", link=frame.name)
    place = numbers(frame.x, frame.y, frame.z)
    SubElement(joint, "origin", xyz=place, rpy=numbers(0, 0, frame.heading))
    if is_wheel:
        # A positive rotation about y (left) drives the wheel along +x (forward).
        SubElement(joint, "axis", xyz=numbers(0, 1, 0))
