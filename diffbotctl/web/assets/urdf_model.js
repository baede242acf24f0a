// A robot from its URDF: links with shapes, joints, and the pose of each shape in the world.
//
// Format: http://wiki.ros.org/urdf/XML. Meshes are left out.

import { IDENTITY, multiply, origin, rotation, translation } from "./matrix4.js";
import { box, cylinder, sphere } from "./solid_shapes.js";

const GREY = [0.6, 0.6, 0.6];

const child = (element, name) => [...(element?.children ?? [])].find((each) => each.tagName === name);
const children = (element, name) => [...element.children].filter((each) => each.tagName === name);
const numbers = (text, otherwise) => (text ? text.trim().split(/\s+/).map(Number) : otherwise);

function originOf(element) {
  const about = child(element, "origin");
  return [numbers(about?.getAttribute("xyz"), [0, 0, 0]), numbers(about?.getAttribute("rpy"), [0, 0, 0])];
}

function shapeOf(geometry, isWheel) {
  const shape = geometry?.firstElementChild;
  const value = (name) => Number(shape.getAttribute(name));
  switch (shape?.tagName) {
    case "box": return box(numbers(shape.getAttribute("size"), [0, 0, 0]));
    case "cylinder": return cylinder(value("radius"), value("length"), isWheel);
    case "sphere": return sphere(value("radius"));
    default: return null;
  }
}

export class UrdfModel {
  /** Raises an error for a text that is no URDF. */
  constructor(text) {
    const root = new DOMParser().parseFromString(text, "application/xml").documentElement;
    if (root.tagName !== "robot") throw new Error("the robot's description is no URDF");
    this.colours = new Map(children(root, "material").map((each) => [
      each.getAttribute("name"), numbers(child(each, "color")?.getAttribute("rgba"), GREY).slice(0, 3),
    ]));
    this.joints = children(root, "joint").map((each) => {
      const [place, turns] = originOf(each);
      return {
        parent: child(each, "parent").getAttribute("link"),
        child: child(each, "child").getAttribute("link"),
        left: place[1],
        origin: origin(place, turns),
        axis: numbers(child(each, "axis")?.getAttribute("xyz"), [1, 0, 0]),
        isWheel: each.getAttribute("type") === "continuous",
        radius: 0,
        angle: 0,
      };
    });
    const wheels = new Map(this.joints.filter((each) => each.isWheel).map((each) => [each.child, each]));
    this.solids = children(root, "link").flatMap((link) => this.solidsOf(link, wheels));
    const inside = new Set(this.joints.map((each) => each.child));
    this.root = children(root, "link").map((each) => each.getAttribute("name")).find((name) => !inside.has(name));
    this.pose = null;
  }

  solidsOf(link, wheels) {
    const name = link.getAttribute("name");
    const wheel = wheels.get(name);
    return children(link, "visual").flatMap((visual) => {
      const geometry = child(visual, "geometry");
      const triangles = shapeOf(geometry, Boolean(wheel));
      if (!triangles) return [];
      if (wheel) wheel.radius = Number(geometry.firstElementChild.getAttribute("radius"));
      const colour = this.colours.get(child(visual, "material")?.getAttribute("name")) ?? GREY;
      return [{ link: name, origin: origin(...originOf(visual)), triangles, colour, isWheel: Boolean(wheel) }];
    });
  }

  /** Move to x, y (m) and heading (rad): each wheel turns by the way that it went. */
  moveTo([x, y, heading]) {
    if (this.pose) {
      const [dx, dy] = [x - this.pose[0], y - this.pose[1]];
      const turn = Math.atan2(Math.sin(heading - this.pose[2]), Math.cos(heading - this.pose[2]));
      const middle = this.pose[2] + turn / 2;
      const forward = dx * Math.cos(middle) + dy * Math.sin(middle);
      for (const joint of this.joints) {
        if (joint.isWheel && joint.radius > 0) joint.angle += (forward - joint.left * turn) / joint.radius;
      }
    }
    this.pose = [x, y, heading];
  }

  /** The pose of each link in the world. */
  links() {
    const [x, y, heading] = this.pose ?? [0, 0, 0];
    const poses = new Map([[this.root, multiply(translation(x, y, 0), rotation([0, 0, 1], heading))]]);
    let waiting = this.joints;
    while (waiting.length) {
      const rest = waiting.filter((joint) => !poses.has(joint.parent));
      for (const joint of waiting) {
        const parent = poses.get(joint.parent);
        if (!parent) continue;
        const turn = joint.isWheel ? rotation(joint.axis, joint.angle) : IDENTITY;
        poses.set(joint.child, multiply(multiply(parent, joint.origin), turn));
      }
      if (rest.length === waiting.length) break; // joints that hang in the air
      waiting = rest;
    }
    return poses;
  }
}
