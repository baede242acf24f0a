// The plots: which fields are shown, their samples, a legend with the newest values.
//
// The server sends samples only while the plots can be seen. What was missed comes, less densely,
// from its memory.

import { drawPanel, sampleOf, STYLES_COUNT } from "./plot_panel.js";

const SAMPLES_MAX = 12000; // of a line: the longest span at 100 Hz
const KEPT = "plots"; // the choice, in the storage of the browser
const FIRST = ["gate.wheels.left", "gate.wheels.right"]; // until somebody chooses
const NUMBERS = ["number", "integer", "boolean"];

const element = (id) => document.getElementById(id);
const topicOf = (name) => name.slice(0, name.lastIndexOf("."));

/** The newest value of a line, as long as the one before: the legend must not move. */
function newestText(line, value) {
  line.hasFractions ||= !Number.isInteger(value);
  const size = Math.abs(value);
  if (!line.hasFractions) return `${value}`;
  if (size >= 1e6 || (size && size < 0.001)) return value.toPrecision(4);
  return value.toFixed(size < 100 ? 3 : 1);
}

/** The names of a choice that was kept, or none. */
function keptNames() {
  try {
    const names = JSON.parse(localStorage.getItem(KEPT));
    if (Array.isArray(names)) return names.filter((name) => typeof name === "string").slice(0, STYLES_COUNT);
  } catch {
    // somebody else wrote it
  }
  return FIRST;
}

export class Plots {
  constructor(connection) {
    this.connection = connection;
    this.topics = [];
    this.units = new Map(); // of each field that was described
    this.lines = []; // {name, slot, times, values, output}
    this.panels = []; // {figure, canvas, lines, unit}
    this.time = 0; // of the run, s
    this.pausedAt = null;
    this.isShown = false;
    this.isDue = false;
    this.chosen = null; // names of the saved view
    element("plot-topic").addEventListener("change", () => this.showFields());
    element("plot-add").addEventListener("click", () => this.add());
    element("plot-span").addEventListener("change", () => this.draw());
    element("plot-pause").addEventListener("click", () => this.pause());
    document.addEventListener("visibilitychange", () => this.ask());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(element("plots"));
  }

  show(isShown) {
    this.isShown = isShown;
    this.ask();
    this.draw();
  }

  /** Ask for the samples of the chosen fields, or for none while they are not visible. */
  ask() {
    const names = this.isShown && !document.hidden ? this.lines.map((line) => line.name) : [];
    this.connection.send({ do: "plot", fields: names });
  }

  describe(topic) {
    this.connection.send({ do: "read", method: "describe_topic", topic });
  }

  /** The topics of the run, again and again. */
  takeTopics(topics) {
    if (topics.join() === this.topics.join()) return;
    const isFirst = !this.topics.length;
    this.topics = topics;
    element("plot-topic").replaceChildren(...topics.map((topic) => new Option(topic)));
    if (isFirst) this.begin();
    this.showFields();
  }

  /** Show the fields of the saved view, or those that the browser has kept. */
  begin() {
    const names = (this.chosen ?? keptNames()).filter((name) => this.topics.includes(topicOf(name)));
    this.lines = [];
    names.forEach((name) => this.addLine(name));
    for (const topic of new Set(names.map(topicOf))) this.describe(topic);
    if (names.length) element("plot-topic").value = topicOf(names[0]);
    this.ask();
  }

  /** Show these fields, the first ones for none, over the last `span` s. */
  choose(names, span) {
    this.chosen = (names.length ? names : FIRST).slice(0, STYLES_COUNT);
    const list = element("plot-span");
    if (![...list.options].some((option) => Number(option.value) === span)) {
      list.append(new Option(`${span} s`, span));
    }
    list.value = span;
    if (this.topics.length) this.begin(); // they were known before the saved view
  }

  /** What is shown: `fields`, separated by commas, and `span` (s). */
  choice() {
    const names = this.topics.length ? this.lines.map((line) => line.name) : this.chosen ?? keptNames();
    return { fields: names.join(), span: element("plot-span").value };
  }

  /** The fields of a topic, with their units. */
  takeFields({ topic, schema }) {
    for (const [field, about] of Object.entries(schema.properties)) {
      const isNumber = [about.type].flat().some((type) => NUMBERS.includes(type));
      if (field !== "time" && isNumber) this.units.set(`${topic}.${field}`, about["x-unit"] ?? "");
    }
    this.units.set(topic, null); // it was described
    this.lines = this.lines.filter((line) => !this.units.has(topicOf(line.name)) || this.units.has(line.name));
    this.showFields();
    this.build();
  }

  showFields() {
    const topic = element("plot-topic").value;
    if (topic && !this.units.has(topic)) this.describe(topic);
    const names = [...this.units.keys()].filter((name) => topicOf(name) === topic);
    const list = element("plot-field");
    const [fields, before] = [names.map((name) => name.slice(topic.length + 1)), list.value];
    if ([...list.options].map((option) => option.value).join() !== fields.join()) {
      list.replaceChildren(...fields.map((field) => new Option(field)));
      if (fields.includes(before)) list.value = before;
    }
    element("plot-add").disabled = !fields.length || this.lines.length >= STYLES_COUNT;
  }

  add() {
    const name = `${element("plot-topic").value}.${element("plot-field").value}`;
    if (!this.units.has(name) || this.lines.some((line) => line.name === name)) return;
    this.addLine(name);
    this.change();
  }

  addLine(name) {
    const taken = this.lines.map((line) => line.slot);
    const slot = [...Array(STYLES_COUNT).keys()].find((each) => !taken.includes(each));
    this.lines.push({ name, slot, times: [], values: [] });
  }

  remove(line) {
    this.lines = this.lines.filter((each) => each !== line);
    this.change();
  }

  /** The choice has changed. */
  change() {
    localStorage.setItem(KEPT, JSON.stringify(this.lines.map((line) => line.name)));
    this.ask();
    this.showFields();
    this.build();
  }

  /** Make the panels: one for each unit, with its legend. */
  build() {
    const units = new Map();
    for (const line of this.lines) {
      const unit = this.units.get(line.name);
      if (unit !== undefined) units.set(unit, [...(units.get(unit) ?? []), line]);
    }
    this.panels = [...units].map(([unit, lines]) => this.panel(unit, lines));
    element("plots").replaceChildren(...this.panels.map((panel) => panel.figure));
    element("plot-hint").hidden = this.lines.length > 0;
    this.draw();
  }

  panel(unit, lines) {
    const figure = document.createElement("figure");
    const legend = document.createElement("figcaption");
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Plot of ${lines.map((line) => line.name).join(", ")}`);
    legend.append(...lines.map((line) => this.legendOf(line, unit)));
    figure.append(legend, canvas);
    return { figure, canvas, lines, unit };
  }

  legendOf(line, unit) {
    const [entry, name, remove] = ["span", "span", "button"].map((tag) => document.createElement(tag));
    line.output = document.createElement("output");
    line.unit = unit;
    name.textContent = line.name;
    remove.textContent = "\u00d7";
    remove.setAttribute("aria-label", `Remove ${line.name}`);
    remove.addEventListener("click", () => this.remove(line));
    entry.append(sampleOf(line.slot), name, line.output, remove);
    return entry;
  }

  /** Samples of the server: time and value of one after the other, by field. */
  take(samples) {
    for (const line of this.lines) {
      const flat = samples[line.name] ?? [];
      let newest = line.times.at(-1) ?? -Infinity;
      for (let i = 0; i < flat.length; i += 2) {
        if (flat[i] <= newest) continue; // it is in the server's memory, and came before
        newest = flat[i];
        line.times.push(newest);
        line.values.push(flat[i + 1] ?? NaN);
      }
      const surplus = line.times.length - SAMPLES_MAX;
      if (surplus > SAMPLES_MAX / 4) for (const list of [line.times, line.values]) list.splice(0, surplus);
    }
    this.draw();
  }

  takeTime(time) {
    this.time = time;
    if (this.lines.length) this.draw();
  }

  pause() {
    this.pausedAt = this.pausedAt === null ? this.time : null;
    element("plot-pause").setAttribute("aria-pressed", this.pausedAt !== null);
    this.draw();
  }

  draw() {
    if (this.isDue || !this.isShown) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      const end = this.pausedAt ?? this.time;
      const begin = Math.max(end - Number(element("plot-span").value), 0); // the run began at 0
      for (const { canvas, lines, unit } of this.panels) {
        drawPanel(canvas, lines, unit, begin, end);
        for (const line of lines) this.showNewest(line, end);
      }
    });
  }

  showNewest(line, end) {
    let last = line.times.length - 1;
    while (last >= 0 && line.times[last] > end) last -= 1;
    const value = last < 0 ? NaN : line.values[last];
    const words = Number.isNaN(value) ? "no data" : `${newestText(line, value)} ${line.unit}`;
    if (line.output.textContent !== words) line.output.textContent = words;
  }
}
