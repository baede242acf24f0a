// The page of a running robot: views, STOP, control and messages.

import { Connection } from "./connection.js";
import { Inside } from "./inside.js";
import { loadLesson } from "./lesson.js";
import { RunMap } from "./map.js";
import { Pad } from "./pad.js";
import { openSavedView, saveView } from "./saved_view.js";

const NOTICE_MS = 6000;
const QUESTION_MS = 700; // for which a question is shown before it takes an answer
const VIEWS = ["drive", "map", "lesson", "inside"];
const element = (id) => document.getElementById(id);
const state = { role: null, allowedGoal: null, noticeTimer: null, connection: "connecting" };

const connection = new Connection(take, showConnection);
const map = new RunMap(element("map"), setGoal);
const pad = new Pad(element("pad"), element("knob"), connection, showVelocity);
const inside = new Inside(connection);
let robotView = null; // in three dimensions, loaded when it is asked for

// A finger may rest on the map while another one drives: there it sets goals in the view Map only.
map.acceptsGoal = (event) =>
  !pad.isPressed && (document.body.dataset.view === "map" || event.pointerType === "mouse");

function take(message) {
  if (message.facts) showPicture(message);
  if (message.role) showRole(message.role);
  if (message.refused) notify(message.refused);
  if (message.lost !== undefined) {
    pad.lock();
    notify(`This page no longer drives: ${message.lost}. Lift the finger, then resume.`);
  }
  if (message.plot) inside.plots.take(message.plot);
  if (message.read) inside.take(message.read, message.reply);
}

function showPicture(picture) {
  map.take(picture);
  inside.plots.takeTime(picture.time);
  robotView?.take();
  if (picture.scene) showScene(picture.scene);
  element("time").textContent = `${picture.time.toFixed(1)} s`;
  showStop(picture.stop);
  document.body.classList.toggle("asks-place", picture.asks_place);
  element("facts").replaceChildren(...picture.facts.map(([name, words, isAlert]) => {
    const row = document.createElement("tr");
    const [head, value] = [document.createElement("th"), document.createElement("td")];
    head.textContent = `${name} `;
    // No line ends between a value and its name or its unit.
    const joints = /\d (?=[a-z])|\b(?:x|y|heading) (?=[+\-\d])/g;
    value.textContent = words.replace(joints, (joint) => joint.replace(" ", "\u00a0"));
    if (isAlert) value.className = "alert";
    row.append(head, value);
    return row;
  }));
}

function showScene(scene) {
  element("title").textContent = document.title = scene.title;
  element("simulated").textContent = scene.simulated;
  element("simulated").hidden = !scene.simulated;
  if (!scene.robot) return;
  pad.limits = { speed: scene.robot.speed, turnRate: scene.robot.turn_rate };
  showLimit();
}

function showStop(stop) {
  const banner = element("banner");
  const words = stop ? `STOPPED  ${stop.code}: ${stop.cause}; ${stop.end}` : "";
  if (banner.textContent !== words) banner.textContent = words;
  banner.hidden = !stop;
  if (stop) element("allow").close();
  element("resume").disabled = false;
}

function showConnection(words) {
  state.connection = words;
  if (words) {
    pad.lock();
    element("allow").close();
  }
  if (connection.ended || !connection.isOpen) element("role").textContent = "not connected";
  else inside.plots.ask(); // a new connection knows nothing of them
  document.body.dataset.connected = words ? "no" : "yes";
  showNotice(words);
}

function showNotice(words) {
  element("notice").textContent = words;
  element("notice").hidden = !words;
}

function notify(words) {
  showNotice(words);
  clearTimeout(state.noticeTimer);
  state.noticeTimer = setTimeout(() => showNotice(state.connection), NOTICE_MS);
}

function showRole(role) {
  state.role = role;
  const driver = role.is_driver ? "this page" : role.driver ?? "none";
  element("role").textContent = `${role.you}; in control: ${driver}`;
  element("take").textContent = role.is_driver ? "Give up control" : "Take control";
  if (!role.driver || role.is_driver) return;
  pad.lock();
  element("allow").close(); // its goal would be refused
}

function showVelocity(linear, angular) {
  element("velocity").textContent = `${linear.toFixed(2)} m/s, ${angular.toFixed(2)} rad/s`;
}

function showLimit() {
  pad.share = element("limit-input").value / 100;
  const { speed, turnRate } = pad.limits;
  element("limit-text").textContent =
    `${(pad.share * speed).toFixed(2)}\u00a0m/s, ${(pad.share * turnRate).toFixed(2)}\u00a0rad/s`;
}

map.onPlace = (x, y, heading) => connection.send({ do: "place", x, y, heading });

function setGoal(x, y, heading) {
  const goal = { do: "goto", x, y, heading };
  if (state.role?.driver && !state.role.is_driver) {
    notify(`${state.role.driver} is in control; take control first`);
  } else if (state.role?.sets_goals) {
    connection.send(goal);
  } else {
    state.allowedGoal = goal;
    askForGoals();
  }
}

/** Ask once. The end of the tap that opens the question, or a second tap, must not answer it. */
function askForGoals() {
  if (element("allow").open) return;
  const yes = element("allow-yes");
  yes.disabled = true;
  setTimeout(() => { yes.disabled = false; }, QUESTION_MS);
  element("allow").show(); // not modal: STOP stays within reach
}

async function switchSolid() {
  const key = element("solid");
  const isSolid = key.getAttribute("aria-pressed") !== "true";
  if (!robotView) {
    key.disabled = true;
    try {
      const { makeRobotView } = await import("./robot_view.js");
      robotView = await makeRobotView(element("robot-view"), map);
      robotView.take();
    } catch (error) {
      notify(`no view in three dimensions: ${error.message}`);
      return;
    } finally {
      key.disabled = false;
    }
  }
  element("allow").close();
  key.setAttribute("aria-pressed", isSolid);
  for (const id of ["map", "fit", "follow"]) element(id).hidden = isSolid;
  for (const id of ["robot-view", "solid-hint"]) element(id).hidden = !isSolid;
  for (const hint of document.querySelectorAll(".map-hint")) hint.hidden = isSolid;
  robotView.show(isSolid);
}

function zoom(factor) {
  (robotView?.isShown ? robotView : map).zoom(factor);
}

function stop() {
  if (!connection.send({ do: "stop" })) notify("STOP does not reach the robot: this page is not connected");
}

function showView(view) {
  document.body.dataset.view = view;
  for (const each of VIEWS) element(`view-${each}`).setAttribute("aria-pressed", each === view);
  element("inside").hidden = view !== "inside";
  element("allow").close();
  pad.release();
  inside.show(view === "inside");
}

for (const view of VIEWS) element(`view-${view}`).addEventListener("click", () => showView(view));
element("stop").addEventListener("pointerdown", stop);
element("stop").addEventListener("keydown", (event) => {
  if (event.key === "Enter" || event.key === " ") stop();
});
element("resume").addEventListener("click", () => connection.send({ do: "resume" }));
element("take").addEventListener("click", () =>
  connection.send({ do: state.role?.is_driver ? "give" : "take" }));
element("limit-input").addEventListener("input", showLimit);
element("zoom-in").addEventListener("click", () => zoom(1.4));
element("zoom-out").addEventListener("click", () => zoom(1 / 1.4));
element("fit").addEventListener("click", () => map.setMode("all"));
element("follow").addEventListener("click", () => map.setMode("robot"));
element("solid").addEventListener("click", switchSolid);
element("save-view").addEventListener("click", () => saveView(map, inside.plots, inside.isShown));
element("allow-yes").addEventListener("click", () => {
  element("allow").close();
  connection.send({ do: "allow_goals" });
  connection.send(state.allowedGoal);
});
element("allow-no").addEventListener("click", () => element("allow").close());
element("fullscreen").addEventListener("click", () => {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().catch(() => notify("this browser has no full screen"));
});
addEventListener("keydown", (event) => {
  if (event.key !== " " || /INPUT|BUTTON/.test(event.target.tagName)) return;
  event.preventDefault();
  stop();
});
addEventListener("hashchange", () => location.hash.length > 1 && location.reload());
connection.enter().then(async () => {
  element("view-lesson").hidden = !await loadLesson(element("lesson"));
  if (!element("view-lesson").hidden) showView("lesson");
  await openSavedView(map, inside.plots, showView);
});
