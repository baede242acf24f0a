// The robot in three dimensions, from its URDF: WebGL on a canvas, a camera that turns around it.

import { IDENTITY, multiply, orbit, perspective, translation } from "./matrix4.js";
import { box, cylinder } from "./solid_shapes.js";
import { UrdfModel } from "./urdf_model.js";

const FIELD_OF_VIEW = 0.7; // rad
const NEAR_M = 0.03;
const FAR_M = 40;
const DISTANCE_START_M = 0.9;
const DISTANCE_MIN_M = 0.15;
const DISTANCE_MAX_M = 12;
const ELEVATION_MIN = 0.05; // rad above the floor
const ELEVATION_MAX = 1.5;
const TURN_PER_PX = 0.008; // rad
const LAMP_ASIDE = 0.5; // rad
const START_ASIDE = 2.5; // rad from the robot's heading: behind it, on its left
const WHEEL_FORWARD = 32; // steps of depth: a wheel's face may lie in the side of the body
const TARGET_HEIGHT_M = 0.05;
const GRID_STEP_M = 0.1;
const GRID_REACH = 20; // lines to each side of the robot
const GRID_PIECE = 4; // steps
const WALL_HEIGHT_M = 0.12;
const WALL_WIDTH_M = 0.01;
const GOAL_HEIGHT_M = 0.2;
const TRAIL_HEIGHT_M = 0.002; // above the grid

const VERTEX = `
attribute vec3 place; attribute vec3 normal; attribute float shade;
uniform mat4 camera; uniform mat4 model; uniform vec3 colour; uniform float lit; uniform vec3 lamp;
varying vec3 seen;
void main() {
  gl_Position = camera * model * vec4(place, 1.0);
  vec3 upright = normalize(mat3(model) * normal);
  float light = 0.6 + 0.4 * dot(upright, lamp);
  seen = mix(colour, (colour * shade + 0.03) * light, lit);
}`;
const FRAGMENT = `
precision mediump float;
varying vec3 seen;
void main() { gl_FragColor = vec4(seen, 1.0); }`;

/** The three parts of a colour such as #0072b2, 0 to 1. */
function parts(colour) {
  return [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
}

/** The direction of the light: from above, beside the camera, so that no face in view is dark. */
function lampOf(heading) {
  return [0.64 * Math.cos(heading + LAMP_ASIDE), 0.64 * Math.sin(heading + LAMP_ASIDE), 0.77];
}

/** A view of the robot on `canvas`. `map` has the scene, the trail and the newest picture. */
export async function makeRobotView(canvas, map) {
  const reply = await fetch("/robot.urdf");
  const text = await reply.text();
  if (!reply.ok) throw new Error(text);
  return new RobotView(canvas, map, new UrdfModel(text));
}

class RobotView {
  constructor(canvas, map, model) {
    const gl = canvas.getContext("webgl", { antialias: true });
    if (!gl) throw new Error("this browser does not draw in three dimensions");
    Object.assign(this, { canvas, map, model, gl });
    this.camera = { heading: (map.state.pose?.[2] ?? 0) + START_ASIDE, elevation: 0.5, distance: DISTANCE_START_M };
    this.pointers = new Map();
    this.isShown = false;
    this.isDue = false;
    this.prepare();
    canvas.addEventListener("pointerdown", (event) => this.onDown(event));
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    // A phone takes the graphics memory of a page in the background.
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.prepare());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? 1.25 : 0.8);
    }, { passive: false });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** Give the graphics processor the program and the shapes. */
  prepare() {
    this.link();
    for (const solid of this.model.solids) solid.buffer = this.bufferOf(solid.triangles);
    this.scene = null; // for which the walls were made
    this.loose = this.gl.createBuffer(); // lines that change with each picture
    this.draw();
  }

  link() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["place", "normal", "shade"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.uniforms = Object.fromEntries(
      ["camera", "model", "colour", "lit", "lamp"].map((name) => [name, gl.getUniformLocation(program, name)]),
    );
  }

  bufferOf(numbers) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    return { buffer, count: numbers.length / 7 };
  }

  show(isShown) {
    this.isShown = isShown;
    this.draw();
  }

  /** A new picture of the run is there. */
  take() {
    const { pose } = this.map.state;
    if (pose) this.model.moveTo(pose);
    this.draw();
  }

  zoom(factor) {
    const distance = this.camera.distance / factor;
    this.camera.distance = Math.min(Math.max(distance, DISTANCE_MIN_M), DISTANCE_MAX_M);
    this.draw();
  }

  onDown(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  onMove(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const place = [event.clientX, event.clientY];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const span = (a) => Math.max(Math.hypot(a[0] - other[0], a[1] - other[1]), 1);
      this.zoom(span(place) / span(before));
    } else {
      const { camera } = this;
      camera.heading -= (place[0] - before[0]) * TURN_PER_PX;
      const elevation = camera.elevation + (place[1] - before[1]) * TURN_PER_PX;
      camera.elevation = Math.min(Math.max(elevation, ELEVATION_MIN), ELEVATION_MAX);
    }
    this.pointers.set(event.pointerId, place);
    this.draw();
  }

  draw() {
    if (this.isDue || !this.isShown) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      if (this.isShown && this.canvas.clientWidth && this.canvas.clientHeight) this.paint();
    });
  }

  paint() {
    const { gl, canvas, camera, map, model } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio].map(Math.round);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, width, height);
    const colours = map.colours;
    gl.clearColor(...parts(colours.back), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [x, y] = model.pose ?? [0, 0];
    const look = orbit([x, y, TARGET_HEIGHT_M], camera.heading, camera.elevation, camera.distance);
    const eye = multiply(perspective(FIELD_OF_VIEW, width / height, NEAR_M, FAR_M), look);
    gl.uniformMatrix4fv(this.uniforms.camera, false, eye);
    gl.uniform3fv(this.uniforms.lamp, lampOf(camera.heading));
    this.lines(this.grid(x, y), parts(colours.line), gl.LINES);
    this.lines(map.trail, parts(colours.trail), gl.LINE_STRIP);
    for (const { pose, buffer } of this.walls()) this.solid(buffer, pose, parts(colours.dim));
    const { goal } = map.state;
    if (goal) this.solid(this.pole, translation(goal[0], goal[1], GOAL_HEIGHT_M / 2), parts(colours.goal));
    const poses = model.links();
    gl.enable(gl.POLYGON_OFFSET_FILL);
    for (const { link, origin, buffer, colour, isWheel } of model.solids) {
      gl.polygonOffset(0, isWheel ? -WHEEL_FORWARD : 0);
      if (poses.has(link)) this.solid(buffer, multiply(poses.get(link), origin), colour);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }

  /** The walls of the scene, made once; and the pole that marks a goal. */
  walls() {
    const { scene } = this.map;
    if (this.scene === scene) return this.standing;
    this.scene = scene;
    this.pole = this.bufferOf(cylinder(0.006, GOAL_HEIGHT_M, false));
    const straight = scene.walls.map(([x1, y1, x2, y2]) => ({
      pose: multiply(
        translation((x1 + x2) / 2, (y1 + y2) / 2, WALL_HEIGHT_M / 2),
        [x2 - x1, y2 - y1, 0, 0, y1 - y2, x2 - x1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1].map(
          (value, i) => (i < 8 ? value / (Math.hypot(x2 - x1, y2 - y1) || 1) : value),
        ),
      ),
      buffer: this.bufferOf(box([Math.hypot(x2 - x1, y2 - y1), WALL_WIDTH_M, WALL_HEIGHT_M])),
    }));
    const round = scene.rounds.map(([x, y, radius]) => ({
      pose: translation(x, y, WALL_HEIGHT_M / 2),
      buffer: this.bufferOf(cylinder(radius, WALL_HEIGHT_M, false)),
    }));
    this.standing = [...straight, ...round];
    return this.standing;
  }

  /** Lines around the robot, in pieces: long ones that pass the camera are not drawn everywhere. */
  grid(x, y) {
    const points = [];
    const [column, row] = [x, y].map((value) => Math.round(value / GRID_STEP_M));
    for (let i = -GRID_REACH; i <= GRID_REACH; i += 1) {
      for (let j = -GRID_REACH; j < GRID_REACH; j += GRID_PIECE) {
        for (const [a, b, c, d] of [[i, j, i, j + GRID_PIECE], [j, i, j + GRID_PIECE, i]]) {
          points.push(...[column + a, row + b, column + c, row + d].map((each) => each * GRID_STEP_M));
        }
      }
    }
    return points;
  }

  /** Lines on the floor through x and y of one point after the other. */
  lines(flat, colour, mode) {
    const { gl } = this;
    if (flat.length < 4) return;
    const height = mode === gl.LINES ? 0 : TRAIL_HEIGHT_M;
    const corners = new Float32Array((flat.length / 2) * 7);
    for (let i = 0; i < flat.length / 2; i += 1) corners.set([flat[2 * i], flat[2 * i + 1], height, 0, 0, 1, 1], 7 * i);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.loose);
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
    this.paintBuffer(IDENTITY, colour, 0, mode, flat.length / 2);
  }

  solid({ buffer, count }, pose, colour) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.paintBuffer(pose, colour, 1, this.gl.TRIANGLES, count);
  }

  paintBuffer(pose, colour, lit, mode, count) {
    const { gl, uniforms } = this;
    [[3, 0], [3, 12], [1, 24]].forEach(([size, offset], i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 28, offset);
    });
    gl.uniformMatrix4fv(uniforms.model, false, pose);
    gl.uniform3fv(uniforms.colour, colour);
    gl.uniform1f(uniforms.lit, lit);
    gl.drawArrays(mode, 0, count);
  }
}
