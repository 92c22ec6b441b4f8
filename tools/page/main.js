// The page: what is played, and what one can do with it.
import { SceneControls, Theme, buildLayers, element, listenToButtons, listenToKeys, logRow, showReadout,
         showState } from "./controls.js";
import { Drive, inWords, lastNotAfter } from "./data.js";
import { Plots } from "./plots.js";
import { Scene, isUnknown } from "./scene.js";

const drive = new Drive(JSON.parse(element("data").textContent));
element("data").remove();
const scene = new Scene(element("canvas"), drive);
const controls = new SceneControls(scene, draw);
const plots = new Plots(element("plots"), drive, (time) => seek(time));
const changes = drive.stateChanges();
const MOST_LINES = 12;
const MOST_FIELDS = 12;  // Of a topic, among the differences.
let shownLine = -1;

let time = 0;
let isPlaying = false;
let lastFrame = null;
let frames = 0;
let isDirty = true;

function draw() {
  isDirty = true;
}

// ---- Time ----

function seek(to) {
  time = Math.min(drive.duration, Math.max(0, to));
  isDirty = true;
}

function setPlaying(plays) {
  if (plays && time >= drive.duration) {
    seek(0);
  }
  isPlaying = plays;
  lastFrame = null;
  element("play").textContent = plays ? "pause" : "play";
}

function changeRate(by) {
  const rate = element("rate");
  rate.selectedIndex = Math.min(rate.options.length - 1, Math.max(0, rate.selectedIndex + by));
}

function frame(now) {
  if (isPlaying) {
    // A page that was not seen for a while goes on where it was.
    const passed = lastFrame === null ? 0 : Math.min(0.25, (now - lastFrame) / 1000);
    lastFrame = now;
    seek(time + passed * Number(element("rate").value));
    if (time >= drive.duration) {
      setPlaying(false);
    }
  }
  if (isDirty) {
    isDirty = false;
    show();
    ++frames;
  }
  requestAnimationFrame(frame);
}

// ---- What is shown of a time ----

function show() {
  scene.draw(time);
  plots.show(time);
  element("slider").value = time;
  element("time").textContent = `${time.toFixed(2)} / ${drive.duration.toFixed(2)} s`;
  showState(drive, time);
  showEvent();
  showReadout(drive, scene, time);
  showLog();
}

function showEvent() {
  const now = changes.findLastIndex((change) => change.time <= time);
  [...element("events").children].forEach((item, i) => item.firstChild.classList.toggle("now", i === now));
}

// The last lines of the log that were written until then.
function showLog() {
  const last = drive.layers.log ? lastNotAfter(drive.layers.log.published, time) : -1;
  if (last === shownLine) {
    return;
  }
  shownLine = last;
  const rows = [];
  for (let i = Math.max(0, last - MOST_LINES + 1); i <= last; ++i) {
    rows.push(logRow(drive.layers.log.get(i)));
  }
  element("log").replaceChildren(...rows);
}

// ---- What is there once ----

function hasLayer(name) {
  return name === "new" ? drive.other : name === "unknown"
    ? drive.messagesOf("objects").some(({ objects }) => objects.some(isUnknown))
    : drive.layers[{ minimal_risk: "plan", velocity: "objects" }[name] ?? name];
}

function buildEvents() {
  element("events_title").hidden = changes.length === 0;
  changes.forEach(({ time: at, state, reason }, i) => {
    const color = `var(--${drive.meaningOf(state)})`;
    const end = changes[i + 1]?.time ?? drive.duration;
    const part = document.createElement("i");
    part.style.cssText = `left:${(100 * at) / drive.duration}%;width:${(100 * (end - at)) / drive.duration}%;background:${color}`;
    element("strip").append(part);

    const button = document.createElement("button");
    const when = Object.assign(document.createElement("span"), { textContent: `${at.toFixed(2)} s` });
    const sign = document.createElement("i");
    sign.style.background = color;
    const what = document.createElement("span");
    what.append(inWords(state), " ",
                Object.assign(document.createElement("small"), { textContent: reason ?? "" }));
    button.append(when, sign, what);
    button.addEventListener("click", () => seek(at));
    const item = document.createElement("li");
    item.append(button);
    element("events").append(item);
  });
  element("strip").hidden = changes.length === 0;
  element("log_title").hidden = !drive.layers.log;
}

// Of a comparison: what of the new drive's messages is different, and by how much. A click leads to where the change
// is the largest.
function buildDifferences() {
  element("differences_title").hidden = !drive.other;
  if (!drive.other) {
    return;
  }
  const short = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "");
  const row = (tag, ...cells) => {
    const line = document.createElement("tr");
    line.append(...cells.map((content) => {
      const cell = document.createElement(tag);
      cell.append(content);
      return cell;
    }));
    return line;
  };
  const table = document.createElement("table");
  for (const { topic, compared, different, missing, new: added, fields } of drive.differences) {
    if (different + missing + added === 0) continue;
    const more = [missing && `${missing} missing`, added && `${added} new`].filter(Boolean);
    table.append(row("th", topic, [`${different} of ${compared}`, ...more].join(", "), "mean", "max"));
    for (const { field, messages, mean, max, max_at: largest, first } of fields.slice(0, MOST_FIELDS)) {
      const place = largest ?? first;
      const button = Object.assign(document.createElement("button"), {
        textContent: field, title: `${place.time_s.toFixed(3)} s, ${place.field}: ${place.recorded} → ${place.now}` });
      button.addEventListener("click", () => seek(place.time_s));
      table.append(row("td", button, String(messages), short(mean), short(max)));
    }
  }
  element("differences").replaceChildren(table.rows.length ? table : "none");
}

// ---- What one can do ----

function listen() {
  const keys = {
    ...controls.keys,
    " ": () => setPlaying(!isPlaying),
    ArrowLeft: (event) => seek(time - (event.shiftKey ? 1 : 0.1)),
    ArrowRight: (event) => seek(time + (event.shiftKey ? 1 : 0.1)),
    ArrowUp: () => changeRate(1),
    ArrowDown: () => changeRate(-1),
    Home: () => seek(0),
    End: () => seek(drive.duration),
    t: () => theme.toggle(),
  };
  listenToKeys(keys);
  listenToButtons({
    ...controls.buttons,
    play: keys[" "],
    begin: keys.Home,
    back: () => seek(time - 0.1),
    forward: () => seek(time + 0.1),
    theme: keys.t,
  });
  element("slider").max = drive.duration;
  element("slider").addEventListener("input", () => seek(Number(element("slider").value)));
}

element("title").textContent = document.title;
buildLayers(scene, hasLayer, draw);
buildEvents();
buildDifferences();
listen();
const theme = new Theme(() => {
  scene.readColors();
  plots.build(scene.color);
  isDirty = true;
});
new ResizeObserver(() => {
  scene.resize();
  plots.resize();
  isDirty = true;
}).observe(element("scene"));
scene.resize();
// drive.html#12.5 begins at 12.5 s.
seek(Number(location.hash.slice(1)) || 0);
requestAnimationFrame(frame);

// For tests, and for whoever opens the browser's console.
window.fastcycle = {
  drive, scene, plots, seek, setPlaying, changes,
  state: () => ({ time, isPlaying, frames, rate: Number(element("rate").value), camera: { ...scene.camera },
                  objects: scene.objects.length }),
};
