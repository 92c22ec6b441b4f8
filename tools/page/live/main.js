// The live page: what the run says is drawn as it comes, and as it was up to a minute ago.
import { SceneControls, Theme, buildLayers, element, listenToButtons, listenToKeys, showReadout,
         showState } from "../controls.js";
import { Scene } from "../scene.js";
import { ChainList } from "./chains.js";
import { Components } from "./components.js";
import { Connection } from "./connection.js";
import { Clock, KEPT_S, LiveDrive } from "./drive.js";
import { Graph } from "./graph.js";
import { Log } from "./log.js";
import { MessageTypes } from "./messages.js";
import { Overview } from "./overview.js";
import { Params } from "./params.js";
import { Playback } from "./playback.js";
import { LivePlots } from "./plots.js";
import { say } from "./rows.js";
import { Tabs } from "./tabs.js";
import { Topics } from "./topics.js";

const BEHIND_S = 0.1;  // Between two messages something moves: so much later than they come it is shown.
const JUMP_S = 0.5;  // What is farther from the newest time than this jumps to it.
const MOST_PACE = 20;
const MOST_STATUS_MS = 8000;

const view = JSON.parse(element("view").textContent);
element("view").remove();

const types = new MessageTypes();
const clock = new Clock();
const connection = new Connection({
  opened, closed, channels, status, graph, time: (ns) => playback.tick(ns),
  playback: (state) => { playback.take(state); showButtons(); draw(); } });
const playback = new Playback(connection, clock, moved);
const shown = { points: false };  // Of the scene's layers; the lidar is most of what there is to send.
const live = new LiveDrive(view, connection, types, clock, (layer) => shown[layer] ?? true);
const scene = new Scene(element("canvas"), live.drive);
Object.assign(scene.shown, shown);
const controls = new SceneControls(scene, draw);

const overview = new Overview(connection, showOverview);
const graphView = new Graph(connection, overview);
const components = new Components(connection, overview);
const chains = new ChainList(connection, overview);
const params = new Params(connection, overview);
const plots = new LivePlots(connection, types, clock, seek, (name) => scene.color(name));
const topics = new Topics(connection, overview, types, (topic, path) => plots.addToChosen(topic, path));
const log = new Log(connection, types, clock, view.layers.log);

let time = 0;
let isLive = true;
let isPlaying = true;
let lastFrame = null;
let frames = 0;
let firstPicture = null;  // In milliseconds since the page was asked for.
let isWide = false;
let isDirty = true;
let drawn = {};  // What the picture is of.
let pace = { since: 0, newest: 0, rate: 1 };

function draw() {
  isDirty = true;
}

// ---- The connection ----

function opened(info, isAnother) {
  if (isAnother) {
    clear();
  }
  document.title = info.name;
  say(element("title"), info.metadata?.application ?? info.name);
  playback.opened(info);
  say(element("connection"), playback.isThere ? "recording" : "live");
  if (playback.isThere && !["topics", "log"].includes(tabs.shown)) tabs.show("topics");
  element("connection").dataset.meaning = "good";
  say(element("notice"), "");
  overview.start();
}

// The run is another one: what was said of the one before does not hold.
function clear() {
  live.clear();
  clock.clear();
  types.clear();
  plots.clear();
  topics.clear();
  params.clear();
  log.clear();
  overview.clear();
  graphView.clear();
  time = 0;
  goLive();
  draw();
}

function channels() {
  live.update();
  attempt(() => log.update());
  buildLayers(scene, hasLayer, layerChanged);
  if (element("layers").childElementCount === 0) {
    element("layers").append("This run has none of the topics that a drive is drawn from.");
  }
  topics.update();
}

function closed(wasOpen, wait) {
  overview.stop();
  say(element("connection"), "not connected");
  element("connection").dataset.meaning = "bad";
  const seconds = Math.max(1, Math.round(wait / 1000));
  say(element("notice"), `${wasOpen || connection.session ? "The connection has ended" : "There is no connection"}: the next try is in `
    + `${seconds} s. A run that starts anew has another address: it prints it.`);
}

let statusTimer;
function status(level, text) {
  say(element("status"), text);
  element("status").className = ["", "careful", "bad"][level] ?? "bad";
  clearTimeout(statusTimer);
  statusTimer = setTimeout(() => say(element("status"), ""), MOST_STATUS_MS);
}

function graph(json) {
  graphView.takeConnections(json);
  if (!overview.isThere && tabs.shown === "graph") {
    graphView.update();
  }
}

// What goes wrong with one part is reported, and leaves the others alone.
function attempt(what) {
  try {
    what();
  } catch (error) {
    status(2, error.message);
  }
}

// ---- Layers ----

function hasLayer(name) {
  const layer = view.layers[{ minimal_risk: "plan", velocity: "objects", unknown: "objects" }[name] ?? name];
  return layer && connection.channels.has(layer.topic);
}

function layerChanged(name) {
  shown[name] = scene.shown[name];
  live.update();
  draw();
}

// ---- Time ----

function oldest() {
  return Math.max(0, clock.newest - KEPT_S);
}

// A recording was moved to another time.
function moved(to) {
  live.forget();
  plots.clear();
  log.forget();
  time = to;
  draw();
}

function seek(to) {
  if (playback.isThere) {
    playback.seek(to);
    return;
  }
  isLive = to >= clock.newest;
  time = Math.min(clock.newest, Math.max(oldest(), to));
  showButtons();
}

function goLive() {
  isLive = isPlaying = true;
  showButtons();
}

function setPlaying(plays) {
  if (playback.isThere) {
    playback.play(plays);
    showButtons();
    return;
  }
  isPlaying = plays;
  isLive = plays && time >= clock.newest - JUMP_S;
  showButtons();
}

function plays() {
  return playback.isThere ? playback.isPlaying : isPlaying;
}

function showButtons() {
  say(element("play"), plays() ? "pause" : "play");
  element("live").setAttribute("aria-pressed", isLive);
}

function changeRate(by) {
  const rate = element("rate");
  rate.selectedIndex = Math.min(rate.options.length - 1, Math.max(0, rate.selectedIndex + by));
  rate.dispatchEvent(new Event("change"));
}

// How fast the run's time passes, beside that of the machine: as over the last half second or more.
function measurePace(now) {
  if (now - pace.since > 500) {
    const passed = (1000 * (clock.newest - pace.newest)) / (now - pace.since);
    pace = { since: now, newest: clock.newest, rate: Math.min(MOST_PACE, Math.max(0, passed)) };
  }
}

function pass(seconds) {
  if (playback.isThere && !playback.isPlaying) {
    time = clock.newest;
  } else if (isLive) {
    // Evenly, and never far from what has come.
    const target = clock.newest - BEHIND_S;
    const ahead = time + seconds * pace.rate;
    time = Math.abs(target - time) > JUMP_S ? target : ahead + (target - ahead) * Math.min(1, 4 * seconds);
    time = Math.min(time, clock.newest);
  } else if (isPlaying) {
    time += seconds * Number(element("rate").value);
    if (time >= clock.newest - BEHIND_S) {
      goLive();
    }
  }
  time = Math.max(time, oldest());
}

function frame(now) {
  const passed = lastFrame === null ? 0 : Math.min(0.25, (now - lastFrame) / 1000);
  lastFrame = now;
  measurePace(now);
  pass(passed);
  // What stands needs no new picture.
  if (isDirty || time !== drawn.time || (isLive && live.messages !== drawn.messages)) {
    isDirty = false;
    drawn = { time, messages: live.messages };
    scene.draw(time);
    ++frames;
    if (firstPicture === null && live.drive.egoAt(time)) {
      firstPicture = now;
    }
    showState(live.drive, time);
    showReadout(live.drive, scene, time);
  }
  showTime();
  plots.show(time);
  log.tick();
  requestAnimationFrame(frame);
}

function showTime() {
  if (playback.isThere) {
    playback.showTime(time);
    return;
  }
  const slider = element("slider");
  const behind = clock.newest - time;
  slider.min = -Math.min(KEPT_S, clock.newest);
  slider.value = isLive ? 0 : -behind;
  say(element("time"), clock.isSet ? `${time.toFixed(2)} s${isLive ? "" : ` (${behind.toFixed(1)} s ago)`}` : "–");
  slider.setAttribute("aria-valuetext", isLive ? "now" : `${behind.toFixed(1)} seconds ago`);
}

// ---- What the run says of itself ----

function showOverview() {
  say(element("notice"), connection.isOpen ? Object.values(live.problems).join("; ") : element("notice").textContent);
  if (tabs.shown === "graph") graphView.update();
  if (tabs.shown === "components") components.update();
  topics.update();
}

const tabs = new Tabs((name) => {
  (name === "chains" ? chains.show() : chains.hide());
  (name === "params" ? params.show() : params.hide());
  topics.setShown(name === "topics");
  log.setShown(name === "log");
  if (name === "graph") {
    graphView.update();
    graphView.fit();
  }
  if (name === "components") components.update();
});

function setWide(wide) {
  isWide = wide;
  element("main").classList.toggle("wide", wide);
  element("wide").setAttribute("aria-pressed", wide);
  graphView.fit();
}

// ---- What one can do ----

const keys = {
  ...controls.keys,
  " ": () => setPlaying(!plays()),
  ArrowLeft: (event) => pausedAt(time - (event.shiftKey ? 1 : 0.1)),
  ArrowRight: (event) => pausedAt(time + (event.shiftKey ? 1 : 0.1)),
  ArrowUp: () => changeRate(1),
  ArrowDown: () => changeRate(-1),
  Home: () => (playback.isThere ? playback.seek(0) : pausedAt(oldest())),
  End: () => (playback.isThere ? playback.seek(playback.length) : goLive()),
  l: goLive,
  w: () => setWide(!isWide),
  t: () => theme.toggle(),
};

// Somebody who steps looks at one time.
function pausedAt(to) {
  if (playback.isThere) {
    playback.seek(to, false);
    showButtons();
    return;
  }
  isPlaying = false;
  seek(to);
  isLive = false;
  showButtons();
}

listenToKeys(keys);
listenToButtons({
  ...controls.buttons,
  play: keys[" "],
  back: () => pausedAt(time - 0.1),
  forward: () => pausedAt(time + 0.1),
  live: goLive,
  wide: keys.w,
  theme: keys.t,
});
element("slider").addEventListener("input", () => {
  const value = Number(element("slider").value);
  if (playback.isThere) {
    playback.seek(value);
    return;
  }
  (value >= 0 ? goLive() : pausedAt(clock.newest + value));
});
const theme = new Theme(() => {
  scene.readColors();
  plots.buildAll();
  draw();
});
new ResizeObserver(() => {
  scene.resize();
  draw();
}).observe(element("scene"));
scene.resize();
document.addEventListener("visibilitychange", () => document.visibilityState === "visible" && connection.hurry());
tabs.show("graph");
showButtons();
connection.open();
requestAnimationFrame(frame);

// For tests, and for whoever opens the browser's console.
window.fastcycle = {
  live, scene, plots, overview, connection, clock, playback, seek, pausedAt, goLive, graph: graphView,
  state: () => ({ time, isLive, isPlaying, frames, firstPicture, newest: clock.newest, messages: live.messages,
                  objects: scene.objects.length, camera: { ...scene.camera }, isConnected: connection.isOpen,
                  subscribed: connection.subscribed() }),
};
