// One panel of the plots: lines of one unit on one scale, over the time of the run.

import { makeAxis } from "./plot_axis.js";

const TICK_HEIGHT_PX = 34; // between two values beside the panel, about
const TICK_WIDTH_PX = 90; // between two times below it
const TOP_PX = 28; // room for the unit above the highest value
const RIGHT_PX = 10;
const BOTTOM_PX = 22;
const VALUE_MARGIN = 0.04; // of the span of the values, so that the frame hides no line
const FONT = "13px system-ui, sans-serif";
const SVG = "http://www.w3.org/2000/svg";

// Each line has dashes of its own: lines are distinct without colours, too.
const STYLES = [
  ["trail", []], ["scan", [9, 5]], ["robot", [2, 4]], ["goal", [12, 4, 2, 4]],
  ["ink", [18, 6]], ["beam", [5, 3]], ["trail", [14, 4, 2, 4, 2, 4]], ["scan", [2, 9]],
];
export const STYLES_COUNT = STYLES.length;

/** The samples of a line between two times, and the one before: two lists. */
function between({ times, values }, begin, end) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < begin) low = middle + 1;
    else high = middle;
  }
  const first = Math.max(low - 1, 0);
  let last = times.length;
  while (last > first && times[last - 1] > end) last -= 1;
  return [times.slice(first, last), values.slice(first, last)];
}

/** A short line in the style of a slot, for the legend. */
export function sampleOf(slot) {
  const picture = document.createElementNS(SVG, "svg");
  const line = document.createElementNS(SVG, "line");
  picture.setAttribute("viewBox", "0 0 40 10");
  picture.setAttribute("class", "sample");
  const [colour, dash] = STYLES[slot];
  const attributes = { x1: 0, y1: 5, x2: 40, y2: 5, "stroke-width": 3, "stroke-dasharray": dash.join(" ") };
  for (const [name, value] of Object.entries(attributes)) line.setAttribute(name, value);
  line.style.stroke = `var(--${colour})`;
  picture.append(line);
  return picture;
}

/** Draw `lines` in `unit` from `begin` to `end` (s). A value of NaN is a gap. */
export function drawPanel(canvas, lines, unit, begin, end) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return;
  const ratio = devicePixelRatio || 1;
  const size = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const context = canvas.getContext("2d");
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = colour("back");
  context.fillRect(0, 0, width, height);
  context.font = FONT;

  const shown = lines.map((line) => between(line, begin, end));
  let [low, high] = [Infinity, -Infinity];
  for (const [, values] of shown) {
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) [low, high] = [0, 0];
  const margin = VALUE_MARGIN * (high - low);
  const valueAxis = makeAxis(low - margin, high + margin, (height - TOP_PX - BOTTOM_PX) / TICK_HEIGHT_PX);
  const labels = valueAxis.ticks.map(valueAxis.label);
  const left = Math.ceil(Math.max(...labels.map((label) => context.measureText(label).width))) + 8;
  const box = { left, top: TOP_PX, width: width - left - RIGHT_PX, height: height - TOP_PX - BOTTOM_PX };
  const timeAxis = makeAxis(begin, end, box.width / TICK_WIDTH_PX);
  const toX = (time) => box.left + timeAxis.share(time) * box.width;
  const toY = (value) => box.top + (1 - valueAxis.share(value)) * box.height;

  context.strokeStyle = colour("grid");
  context.fillStyle = colour("dim");
  context.lineWidth = 1;
  context.beginPath();
  context.textAlign = "right";
  valueAxis.ticks.forEach((tick, i) => {
    context.moveTo(box.left, toY(tick));
    context.lineTo(box.left + box.width, toY(tick));
    context.fillText(labels[i], box.left - 6, toY(tick) + 4);
  });
  context.textAlign = "left";
  context.fillText(unit, 0, TOP_PX - 14);
  context.textAlign = "center";
  for (const tick of timeAxis.ticks) {
    context.moveTo(toX(tick), box.top);
    context.lineTo(toX(tick), box.top + box.height);
    const text = `${timeAxis.label(tick)} s`;
    const half = context.measureText(text).width / 2;
    context.fillText(text, Math.min(Math.max(toX(tick), half), width - half), height - 6);
  }
  context.stroke();
  context.strokeStyle = colour("line");
  context.strokeRect(box.left, box.top, box.width, box.height);

  context.save();
  context.beginPath();
  context.rect(box.left, 0, box.width, height);
  context.clip();
  context.lineJoin = "round";
  context.lineWidth = 2;
  lines.forEach((line, i) => {
    const [name, dash] = STYLES[line.slot];
    context.strokeStyle = colour(name);
    context.setLineDash(dash);
    context.beginPath();
    traceLine(context, ...shown[i], toX, toY);
    context.stroke();
  });
  context.restore();
}

/** Add the path of a line: of the samples in one column of pixels only the ends and the extremes. */
function traceLine(context, times, values, toX, toY) {
  let isDown = false;
  for (let i = 0; i < times.length; ) {
    const column = Math.floor(toX(times[i]));
    let [low, high, last] = [i, i, i];
    let next = i + 1;
    while (next < times.length && !Number.isNaN(values[next]) && Math.floor(toX(times[next])) === column) {
      if (values[next] < values[low]) low = next;
      if (values[next] > values[high]) high = next;
      last = next;
      next += 1;
    }
    if (Number.isNaN(values[i])) {
      isDown = false;
      i += 1;
      continue;
    }
    for (const at of new Set([i, Math.min(low, high), Math.max(low, high), last])) {
      const [x, y] = [toX(times[at]), toY(values[at])];
      if (isDown) context.lineTo(x, y);
      else context.moveTo(x, y);
      isDown = true;
    }
    i = next;
  }
}
