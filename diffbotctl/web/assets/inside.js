// The view of the inside: why the robot stopped, plots, blocks, topics, parameters and the log.

import { Plots } from "./plots.js";

const PERIOD_MS = 1000;
const READS = ["explain_stop", "list_blocks", "list_topics", "list_parameters", "read_log"];

const element = (id) => document.getElementById(id);
const text = (value, unit = "", digits = 2) =>
  value === null || value === undefined ? "" : `${typeof value === "number" ? +value.toFixed(digits) : value}${unit}`;

/** Fill a table. A cell is a text or an element. Texts are set as texts: they come from elsewhere. */
function fill(table, names, rows) {
  const head = document.createElement("tr");
  for (const name of names) head.append(cell("th", name));
  table.replaceChildren(head, ...rows.map((row) => {
    const line = document.createElement("tr");
    for (const value of row) line.append(cell("td", value));
    return line;
  }));
}

function cell(tag, value) {
  const made = document.createElement(tag);
  if (value instanceof Node) made.append(value);
  else made.textContent = value;
  return made;
}

export class Inside {
  constructor(connection) {
    this.connection = connection;
    this.isShown = false;
    this.turn = 0;
    this.plots = new Plots(connection);
    setInterval(() => this.ask(), PERIOD_MS / READS.length);
  }

  show(isShown) {
    this.isShown = isShown;
    this.turn = 0;
    this.plots.show(isShown);
    if (isShown) for (let i = 0; i < READS.length; i += 1) this.ask();
  }

  ask() {
    if (!this.isShown || document.hidden) return;
    this.connection.send({ do: "read", method: READS[this.turn % READS.length] });
    this.turn += 1;
  }

  take(method, reply) {
    if (method === "explain_stop") element("why").textContent = reply.text;
    if (method === "list_blocks") this.showBlocks(reply.blocks);
    if (method === "list_topics") this.showTopics(reply.topics);
    if (method === "describe_topic") this.plots.takeFields(reply);
    if (method === "list_parameters") this.showParameters(reply.parameters);
    if (method === "read_log") this.showLog(reply.lines);
  }

  showBlocks(rows) {
    fill(element("blocks"), ["block", "rate", "age", "load", "last error"], rows.map((row) => [
      row.block, text(row.rate, " Hz", 0), text(row.age, " s", 1),
      row.busy === null ? "" : text(100 * row.busy, " %"),
      row.last_error ? `${text(row.last_error.time / 1e9, " s", 1)}: ${row.last_error.text}` : "",
    ]));
  }

  showTopics(rows) {
    this.plots.takeTopics(rows.map((row) => row.topic));
    fill(element("topics"), ["topic", "type", "rate", "age"], rows.map((row) => [
      row.topic, row.type, text(row.rate, " Hz", 1), text(row.age, " s", 1),
    ]));
  }

  showParameters(rows) {
    const table = element("parameters");
    if (table.contains(document.activeElement)) return; // somebody types in it
    const live = rows.filter((row) => row.live);
    fill(table, ["parameter", "value", "unit", "description"], live.map((row) => [
      row.parameter, this.input(row), row.unit, row.help,
    ]));
  }

  input(row) {
    const input = document.createElement("input");
    input.value = row.value === null ? "none" : text(row.value, "", 6);
    input.setAttribute("aria-label", row.parameter);
    if (row.changed) input.style.fontWeight = "700";
    input.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      this.connection.send({ do: "set", parameter: row.parameter, value: input.value });
      input.blur();
    });
    return input;
  }

  showLog(lines) {
    const box = element("log");
    box.replaceChildren(...lines.slice().reverse().map((line) => {
      const row = document.createElement("div");
      const level = ["warning", "error"].includes(line.level) ? `${line.level.toUpperCase()}  ` : "";
      row.textContent = `${(line.time / 1e9).toFixed(2).padStart(8)} s  ${level}${line.source}: ${line.text}`;
      if (level) row.className = "alert";
      return row;
    }));
  }
}
