// The map: walls, trail, scan, goal and robot on a canvas, in metres in the frame of the pose.
//
// A tap sets a goal, a drag a goal with a heading; two fingers, the wheel or the right button zoom
// and pan.

const TRAIL_MAX = 3000;
const GOAL_ARROW_PX = 40;
const FIT_BORDER_PX = 24;
const KEYS_WIDTH_PX = 84; // of the keys on the right, under which nothing is fitted
const FIT_SCALE_MAX = 600; // px/m
const FIT_ROUNDS = 5;
const START_MARGIN_M = 0.3; // floor kept in view around the start
const DRAG_MIN_PX = 14; // a shorter drag is a tap
const BEAM_HALF_ANGLE = 0.09; // rad; about 10 degrees wide, as on the dashboard
const SCALE_MIN = 5; // px/m
const SCALE_MAX = 5000;
const WHEEL_WIDTH_M = 0.025;
const TILE_CELLS = 64; // on each side, as in geometry/map_tiles.py
const CANDIDATE_PX = 60; // a tap so near to a possible place means that place

export class RunMap {
  /** `onGoal` takes x, y (m) and a heading (rad) or null. */
  constructor(canvas, onGoal) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.onGoal = onGoal;
    this.acceptsGoal = () => true;
    this.scene = { walls: [], rounds: [], field: [], sensors: [], robot: null };
    this.trail = [];
    this.scans = {};
    this.tiles = new Map(); // of the robot's own map: its pictures, by column and row
    this.tileSide = 0; // m
    this.mapNumber = 0;
    this.onPlace = () => {}; // takes x, y (m) and heading (rad) in the robot's map
    this.state = {};
    this.camera = { x: 0, y: 0, scale: 200 };
    this.mode = "all"; // all, robot or free
    this.shownWidth = 0; // m, from edge to edge, when it was painted last
    this.requestedWidth = 0; // m; the scale follows when the size of the canvas is known
    this.pointers = new Map();
    this.draft = null; // a goal that is being dragged
    this.isDue = false;
    this.readColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.readColours();
      this.draw();
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => this.onDown(event));
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    canvas.addEventListener("pointerup", (event) => this.onUp(event));
    canvas.addEventListener("pointercancel", (event) => this.onCancel(event));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    this.colours = new Proxy({}, { get: (_, name) => style.getPropertyValue(`--${name}`).trim() });
  }

  /** A picture of the server: everything, or what has changed. */
  take(picture) {
    if (picture.scene) this.scene = picture.scene;
    if (picture.trail_begins) this.trail = [];
    this.trail.push(...picture.trail);
    if (this.trail.length > 2 * TRAIL_MAX) this.trail.splice(0, this.trail.length - 2 * TRAIL_MAX);
    Object.assign(this.scans, picture.scans);
    if (picture.map) this.takeTiles(picture.map);
    this.state = picture;
    this.draw();
  }

  takeTiles({ number, resolution, tiles }) {
    if (number !== this.mapNumber) this.tiles.clear();
    this.mapNumber = number;
    this.tileSide = TILE_CELLS * resolution;
    for (const [column, row, text] of tiles) {
      this.tiles.set(`${column} ${row}`, { column, row, ...this.tilePicture(text) });
    }
  }

  /**
   * Runs of cells, row after row from the lowest y on, as a picture whose first row is the top, and
   * the cells between which the occupied ones are.
   */
  tilePicture(text) {
    const picture = new OffscreenCanvas(TILE_CELLS, TILE_CELLS);
    const context = picture.getContext("2d");
    const image = context.createImageData(TILE_CELLS, TILE_CELLS);
    const shades = { "#": [90, 90, 200, 255], ".": [128, 128, 128, 40] };
    const occupied = [TILE_CELLS, TILE_CELLS, 0, 0]; // columns and rows: the lowest two, the highest two
    let at = 0;
    for (const [, count, cell] of text.matchAll(/(\d+)([u.#])/g)) {
      for (const end = Math.min(at + Number(count), TILE_CELLS ** 2); at < end; at++) {
        const [row, column] = [Math.floor(at / TILE_CELLS), at % TILE_CELLS];
        if (shades[cell]) image.data.set(shades[cell], 4 * ((TILE_CELLS - 1 - row) * TILE_CELLS + column));
        if (cell !== "#") continue;
        [column, row].forEach((each, axis) => {
          occupied[axis] = Math.min(occupied[axis], each);
          occupied[axis + 2] = Math.max(occupied[axis + 2], each + 1);
        });
      }
    }
    context.putImageData(image, 0, 0);
    return { picture, occupied };
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.draw();
  }

  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      if (this.width && this.height) this.paint();
    });
  }

  // Camera.

  toScreen(x, y) {
    const { camera } = this;
    return [
      this.width / 2 + (x - camera.x) * camera.scale,
      this.height / 2 - (y - camera.y) * camera.scale,
    ];
  }

  toFloor(px, py) {
    const { camera } = this;
    return [
      camera.x + (px - this.width / 2) / camera.scale,
      camera.y - (py - this.height / 2) / camera.scale,
    ];
  }

  /** Zoom by `factor`; the floor at the pixel stays where it is. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toFloor(px, py);
    const { camera } = this;
    const before = camera.scale;
    camera.scale = Math.min(Math.max(before * factor, SCALE_MIN), SCALE_MAX);
    // The map may be hidden before it is painted again.
    this.shownWidth *= before / camera.scale;
    this.requestedWidth /= factor;
    camera.x = x - (px - this.width / 2) / camera.scale;
    camera.y = y + (py - this.height / 2) / camera.scale;
    if (this.mode === "all") this.mode = "free";
    this.draw();
  }

  pan(dx, dy) {
    this.camera.x -= dx / this.camera.scale;
    this.camera.y += dy / this.camera.scale;
    this.mode = "free";
    this.draw();
  }

  setMode(mode) {
    this.mode = mode;
    this.draw();
  }

  /** Show the floor around a place; `width` is from edge to edge. All in m. */
  showPart(x, y, width, follows) {
    [this.camera.x, this.camera.y, this.requestedWidth] = [x, y, width];
    this.setMode(follows ? "robot" : "free");
  }

  /** What is shown: `x`, `y`, `width` (m) and `follow`; empty when everything is kept in view. */
  shownPart() {
    if (this.mode === "all") return {};
    const { x, y } = this.camera;
    return { x, y, width: this.requestedWidth || this.shownWidth, follow: this.mode === "robot" };
  }

  follow() {
    const { pose } = this.state;
    if (this.draft || this.pointers.size || !pose) return; // the floor must not move under a finger
    if (this.mode === "robot") [this.camera.x, this.camera.y] = pose;
    if (this.mode !== "all") return;
    const { robot } = this.scene;
    const places = [
      [0, 0, START_MARGIN_M],
      [pose[0], pose[1], robot ? Math.hypot(Math.max(robot.front, robot.back), robot.width / 2) : 0],
      ...this.scene.field.map(([x, y]) => [x, y, 0]),
      ...this.candidates().map((place) => [...this.ofMap(...place).slice(0, 2), START_MARGIN_M]),
      ...this.mapEnds(),
    ];
    for (let i = 0; i < this.trail.length; i += 2) places.push([this.trail[i], this.trail[i + 1], 0]);
    this.camera = this.fitted(places, this.state.goal);
  }

  /** Places between which all walls of the robot's map are. */
  mapEnds() {
    const ends = [];
    for (const { column, row, occupied: [left, low, right, high] } of this.tiles.values()) {
      if (right <= left) continue;
      for (const x of [left, right]) {
        for (const y of [low, high]) {
          const place = [column + x / TILE_CELLS, row + y / TILE_CELLS].map((each) => each * this.tileSide);
          ends.push([...this.ofMap(...place).slice(0, 2), 0]);
        }
      }
    }
    return ends;
  }

  /** A camera that shows all `places` (x, y and what is around them, in m), and a goal's arrow. */
  fitted(places, goal) {
    const room = [this.width - KEYS_WIDTH_PX - 2 * FIT_BORDER_PX, this.height - 2 * FIT_BORDER_PX];
    // Beside the joystick of a small phone the map is lower than its borders.
    const [width, height] = [Math.max(room[0], this.width / 3), Math.max(room[1], this.height / 3)];
    const arrow = Math.min(GOAL_ARROW_PX, width / 4, height / 4);
    const bounds = (axis, margin) => {
      const ends = places.flatMap((place) => [place[axis] - place[2], place[axis] + place[2]]);
      if (goal) ends.push(goal[axis] - margin, goal[axis] + margin);
      return ends.reduce(([low, high], end) => [Math.min(low, end), Math.max(high, end)], [ends[0], ends[0]]);
    };
    let [scale, xs, ys] = [FIT_SCALE_MAX];
    for (let round = 0; round < FIT_ROUNDS; round++) { // the arrow's length in m follows from the scale
      [xs, ys] = [bounds(0, arrow / scale), bounds(1, arrow / scale)];
      scale = Math.min(width / (xs[1] - xs[0]), height / (ys[1] - ys[0]), FIT_SCALE_MAX);
    }
    return { x: (xs[0] + xs[1] + KEYS_WIDTH_PX / scale) / 2, y: (ys[0] + ys[1]) / 2, scale };
  }

  // Fingers and mouse.

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  onDown(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const place = this.place(event);
    this.pointers.set(event.pointerId, place);
    const isGoal = event.button === 0 && this.pointers.size === 1 && this.acceptsGoal(event);
    this.draft = isGoal ? { start: place, end: place } : null;
    this.draw();
  }

  onMove(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const place = this.place(event);
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const span = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
      const middle = (a) => [(a[0] + other[0]) / 2, (a[1] + other[1]) / 2];
      const [was, is] = [middle(before), middle(place)];
      this.pan(is[0] - was[0], is[1] - was[1]);
      this.zoom(span(place, other) / Math.max(span(before, other), 1), ...is);
    } else if (this.draft) {
      this.draft.end = place;
    } else {
      this.pan(place[0] - before[0], place[1] - before[1]);
    }
    this.pointers.set(event.pointerId, place);
    this.draw();
  }

  onUp(event) {
    this.pointers.delete(event.pointerId);
    const { draft } = this;
    this.draft = null;
    if (draft && this.state.asks_place) this.onPlace(...this.placeOf(draft));
    else if (draft) this.onGoal(...this.goalOf(draft));
    this.draw();
  }

  onCancel(event) {
    this.pointers.delete(event.pointerId);
    this.draft = null;
    this.draw();
  }

  onWheel(event) {
    event.preventDefault();
    this.zoom(event.deltaY < 0 ? 1.25 : 0.8, ...this.place(event));
  }

  goalOf({ start, end }) {
    const [x, y] = this.toFloor(...start);
    if (Math.hypot(end[0] - start[0], end[1] - start[1]) < DRAG_MIN_PX) return [x, y, null];
    return [x, y, Math.atan2(start[1] - end[1], end[0] - start[0])];
  }

  /** The place in the robot's map that is meant: a possible one that is near, or any other. */
  placeOf(draft) {
    const places = this.candidates().map((place) => ({ place, at: this.toScreen(...this.ofMap(...place)) }));
    const away = ({ at }) => Math.hypot(at[0] - draft.start[0], at[1] - draft.start[1]);
    const [nearest] = places.sort((a, b) => away(a) - away(b));
    if (nearest && away(nearest) < CANDIDATE_PX) return nearest.place;
    const [x, y, heading] = this.goalOf(draft);
    const [ox, oy, turn] = this.state.odom;
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    return [ox + c * x - s * y, oy + s * x + c * y, heading === null ? null : turn + heading];
  }

  candidates() {
    const flat = this.state.candidates ?? [];
    return Array.from({ length: flat.length / 3 }, (_, i) => flat.slice(3 * i, 3 * i + 3));
  }

  /** A place in the robot's map, in odom. */
  ofMap(x, y, heading = 0) {
    const [ox, oy, turn] = this.state.odom ?? [0, 0, 0];
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    return [c * (x - ox) + s * (y - oy), c * (y - oy) - s * (x - ox), heading - turn];
  }

  paintTiles() {
    const { context, tileSide, camera } = this;
    if (!this.tiles.size) return;
    const turn = this.state.odom?.[2] ?? 0;
    const side = tileSide * camera.scale;
    context.save();
    context.imageSmoothingEnabled = false;
    context.translate(...this.toScreen(...this.ofMap(0, 0)));
    context.rotate(turn); // y points down on the screen
    for (const { column, row, picture } of this.tiles.values()) {
      context.drawImage(picture, column * side, -(row + 1) * side, side, side);
    }
    context.restore();
  }

  // Drawing.

  paint() {
    const { context, colours } = this;
    if (this.requestedWidth) this.camera.scale = Math.min(Math.max(this.width / this.requestedWidth, SCALE_MIN), SCALE_MAX);
    this.requestedWidth = 0;
    this.follow();
    this.shownWidth = this.width / this.camera.scale; // of a new camera when all is kept in view
    const ratio = this.canvas.width / this.width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = colours.back;
    context.fillRect(0, 0, this.width, this.height);
    context.lineJoin = "round";
    const step = this.paintGrid();
    this.paintTiles();
    for (const [x1, y1, x2, y2] of this.scene.walls) this.line([x1, y1, x2, y2], colours.wall, 3);
    for (const [x, y, radius] of this.scene.rounds) this.circle(x, y, radius, colours.wall, 3);
    this.line(this.trail, colours.trail, 2);
    this.paintGoals();
    for (const place of this.candidates()) this.paintGoal(...this.ofMap(...place));
    const { pose } = this.state;
    if (pose) {
      for (const sensor of this.scene.sensors) this.paintSensor(pose, sensor);
      this.paintEllipse(pose);
      this.paintRobot(pose);
    }
    if (this.draft) {
      const [x, y, heading] = this.goalOf(this.draft);
      this.paintGoal(x, y, heading);
    }
    this.paintScale(step);
  }

  paintGrid() {
    const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];
    const step = steps.find((each) => each * this.camera.scale >= 60) ?? 100;
    const [left, top] = this.toFloor(0, 0);
    const [right, bottom] = this.toFloor(this.width, this.height);
    for (let x = Math.ceil(left / step) * step; x < right; x += step) {
      this.line([x, top, x, bottom], this.colours.grid, 1);
    }
    for (let y = Math.ceil(bottom / step) * step; y < top; y += step) {
      this.line([left, y, right, y], this.colours.grid, 1);
    }
    return step;
  }

  paintScale(step) {
    const { context, colours } = this;
    const [left, y] = [12, this.height - 12];
    context.strokeStyle = context.fillStyle = colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(left, y - 6);
    context.lineTo(left, y);
    context.lineTo(left + step * this.camera.scale, y);
    context.lineTo(left + step * this.camera.scale, y - 6);
    context.stroke();
    context.font = "13px system-ui, sans-serif";
    context.fillText(step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`, left + 6, y - 6);
  }

  /** A line through x and y of one point after the other. */
  line(points, colour, width, dash = []) {
    if (points.length < 4) return;
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(...this.toScreen(points[0], points[1]));
    for (let i = 2; i < points.length; i += 2) {
      context.lineTo(...this.toScreen(points[i], points[i + 1]));
    }
    context.stroke();
    context.setLineDash([]);
  }

  circle(x, y, radius, colour, width) {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    context.arc(...this.toScreen(x, y), radius * this.camera.scale, 0, 2 * Math.PI);
    context.stroke();
  }

  paintGoals() {
    const { goal, path, pose } = this.state;
    const { colours } = this;
    if (path?.length) {
      this.line(path.flat(), colours.goal, 1, [4, 4]);
      for (const [x, y] of path) this.circle(x, y, 4 / this.camera.scale, colours.goal, 2);
    }
    if (!goal) return;
    if (pose) this.line([pose[0], pose[1], goal[0], goal[1]], colours.goal, 1, [2, 6]);
    this.paintGoal(...goal);
  }

  /** A ring with a cross, and an arrow towards the heading: its form distinguishes it from the rest. */
  paintGoal(x, y, heading) {
    const { colours } = this;
    const unit = 1 / this.camera.scale;
    this.circle(x, y, 10 * unit, colours.goal, 3);
    this.line([x - 5 * unit, y, x + 5 * unit, y], colours.goal, 2);
    this.line([x, y - 5 * unit, x, y + 5 * unit], colours.goal, 2);
    if (heading === null) return;
    const at = (length, turn) => [
      x + length * unit * Math.cos(heading + turn), y + length * unit * Math.sin(heading + turn),
    ];
    this.line([...at(10, 0), ...at(GOAL_ARROW_PX, 0)], colours.goal, 3);
    this.line([...at(31, 0.22), ...at(GOAL_ARROW_PX, 0), ...at(31, -0.22)], colours.goal, 3);
  }

  /** A place in base_link, in the frame of the map. */
  toMap(pose, forward, left) {
    const [c, s] = [Math.cos(pose[2]), Math.sin(pose[2])];
    return [pose[0] + c * forward - s * left, pose[1] + s * forward + c * left];
  }

  paintSensor(pose, sensor) {
    const [x, y] = this.toMap(pose, sensor.x, sensor.y);
    const heading = pose[2] + sensor.heading;
    const at = (angle, length) => [x + length * Math.cos(angle), y + length * Math.sin(angle)];
    const scan = this.scans[sensor.topic];
    if (scan) {
      // The robot has moved on since the scan was measured; what it met has not.
      const [scanX, scanY] = this.toMap(scan.pose ?? pose, sensor.x, sensor.y);
      const scanHeading = (scan.pose ?? pose)[2] + sensor.heading;
      this.context.fillStyle = this.colours.scan;
      scan.mm.forEach((mm, i) => {
        if (!mm || mm > sensor.reach * 1000) return;
        const [angle, distance] = [scanHeading + scan.start + i * scan.step, mm / 1000];
        const [px, py] = this.toScreen(scanX + distance * Math.cos(angle), scanY + distance * Math.sin(angle));
        this.context.fillRect(px - 1.5, py - 1.5, 3, 3);
      });
    }
    const range = this.state.ranges?.[sensor.topic];
    if (!range) return;
    const [state, distance] = range;
    const length = state === "measured" ? distance : state === "clear" ? sensor.reach : 0;
    const [right, left] = [at(heading - BEAM_HALF_ANGLE, length), at(heading + BEAM_HALF_ANGLE, length)];
    this.line([...right, x, y, ...left], this.colours.beam, 1.5, [6, 4]);
    if (state === "measured") this.line([...right, ...left], this.colours.scan, 3);
  }

  paintEllipse([x, y, , major, minor, direction]) {
    const { context, camera } = this;
    if (major * camera.scale < 2) return;
    context.strokeStyle = this.colours.trail;
    context.lineWidth = 1;
    context.setLineDash([3, 3]);
    context.beginPath();
    context.ellipse(...this.toScreen(x, y), major * camera.scale, minor * camera.scale, -direction, 0, 7);
    context.stroke();
    context.setLineDash([]);
  }

  paintRobot(pose) {
    const { robot } = this.scene;
    const { context, colours, camera } = this;
    const polygon = (corners, fill, stroke) => {
      context.beginPath();
      for (const [f, l] of corners) context.lineTo(...this.toScreen(...this.toMap(pose, f, l)));
      context.closePath();
      context.fillStyle = fill;
      context.fill();
      context.strokeStyle = stroke;
      context.lineWidth = 2;
      context.stroke();
    };
    const side = robot ? robot.width / 2 : 0;
    if (robot && (robot.front + robot.back) * camera.scale >= 16) {
      const { front, back, track } = robot;
      polygon([[front, side], [front, -side], [-back, -side], [-back, side]], colours["robot-fill"], colours.robot);
      for (const [left, diameter] of [[track / 2, robot.left_diameter], [-track / 2, robot.right_diameter]]) {
        const [r, w] = [diameter / 2, WHEEL_WIDTH_M / 2];
        polygon([[r, left - w], [r, left + w], [-r, left + w], [-r, left - w]], colours.ink, colours.ink);
      }
    }
    const size = Math.max(9 / camera.scale, robot ? 0.35 * robot.front : 0);
    polygon([[size * 1.4, 0], [-size * 0.7, size * 0.8], [-size * 0.7, -size * 0.8]], colours.robot, colours.back);
  }
}
