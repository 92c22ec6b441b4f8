// The page: what is played, and what one can do with it.
import { Drive, fixed, inWords, lastNotAfter } from "./data.js";
import { Plots } from "./plots.js";
import { LAYERS, Scene, isUnknown } from "./scene.js";

const element = (id) => document.getElementById(id);

const drive = new Drive(JSON.parse(element("data").textContent));
element("data").remove();
const scene = new Scene(element("canvas"), drive);
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
  showState();
  showReadout();
  showLog();
}

function showState() {
  const state = drive.layers.state?.lastPublished(time);
  const badge = element("state");
  badge.hidden = !state;
  const plan = drive.layers.plan?.lastPublished(time);
  const planReason = plan?.reason ? `plan: ${plan.reason}` : "";
  element("reason").textContent = [state?.reason, planReason].filter(Boolean).join(" · ");
  element("reason").title = element("reason").textContent;
  if (state) {
    badge.textContent = inWords(state.state);
    badge.style.background = `var(--${drive.meaningOf(state.state)})`;
  }
  const now = changes.findLastIndex((change) => change.time <= time);
  [...element("events").children].forEach((item, i) => item.firstChild.classList.toggle("now", i === now));
}

function showReadout() {
  const ego = drive.egoAt(time);
  const plan = drive.layers.plan?.lastPublished(time);
  const lines = [];
  if (ego) {
    const motion = [[ego.speed, "m/s"], [ego.acceleration, "m/s²"]].filter(([value]) => Number.isFinite(value));
    lines.push(...motion.length ? [motion.map(([value, unit]) => `${fixed(value, 1)} ${unit}`).join("  ")] : []);
    if (ego.quality && ego.quality !== "GOOD") {
      lines.push(`position ${inWords(ego.quality)}`);
    }
  }
  if (plan?.kind) {
    lines.push(`plan ${inWords(plan.kind)}`);
  }
  if (drive.layers.objects) {
    lines.push(`${scene.objects.length} objects` + (scene.unknown.length > 0 ? `, ${scene.unknown.length} unknown` : ""));
  }
  element("readout").textContent = lines.join("\n");
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
    const { published, level, component, text, lost } = drive.layers.log.get(i);
    const word = String(level).replace("LOG_LEVEL_", "").toLowerCase();
    const row = document.createElement("tr");
    row.className = word;
    const words = [`${published.toFixed(2)} s`, word, component, lost > 0 ? `(${lost} lines are missing) ${text}` : text];
    row.append(...words.map((one) => Object.assign(document.createElement("td"), { textContent: one })));
    rows.push(row);
  }
  element("log").replaceChildren(...rows);
}

// ---- What is there once ----

function buildLayers() {
  const has = (name) => name === "new" ? drive.other : name === "unknown"
    ? drive.messagesOf("objects").some(({ objects }) => objects.some(isUnknown))
    : drive.layers[{ minimal_risk: "plan", velocity: "objects" }[name] ?? name];
  for (const [name, text, color] of LAYERS) {
    if (!has(name)) continue;
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true, id: `show_${name}` });
    box.addEventListener("change", () => {
      scene.shown[name] = box.checked;
      isDirty = true;
    });
    const sign = document.createElement("i");
    sign.style.background = `var(${color})`;
    label.append(box, sign, text);
    element("layers").append(label);
  }
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

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  scene.readColors();
  plots.build(scene.color);
  isDirty = true;
}

function toggleTheme() {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
}

// ---- What one can do ----

function setFollow(follows) {
  scene.camera.follows = follows;
  element("follow").setAttribute("aria-pressed", follows);
  isDirty = true;
}

function setTurn(turns) {
  scene.camera.turns = turns;
  element("turn").setAttribute("aria-pressed", turns);
  isDirty = true;
}

function zoom(factor, ...place) {
  scene.zoom(factor, ...place);
  isDirty = true;
}

function listenToPointers() {
  const canvas = element("canvas");
  const pointers = new Map();
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const middle = () => {
    const [[ax, ay], [bx, by] = [ax, ay]] = [...pointers.values()];
    return { x: (ax + bx) / 2, y: (ay + by) / 2, reach: Math.hypot(ax - bx, ay - by) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, place(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) {
      showHint(...place(event));
      return;
    }
    const before = middle();
    pointers.set(event.pointerId, place(event));
    const after = middle();
    if (before.x !== after.x || before.y !== after.y) {
      scene.pan(before.x, before.y, after.x, after.y);
      setFollow(false);
    }
    if (before.reach > 0 && after.reach > 0) {
      zoom(after.reach / before.reach, after.x, after.y);
    }
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => {
      pointers.delete(event.pointerId);
      showHint(...place(event));
    });
  }
  canvas.addEventListener("pointerleave", () => (element("hint").hidden = true));
  canvas.addEventListener("dblclick", () => setFollow(true));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 500), ...place(event));
  }, { passive: false });
}

function showHint(x, y) {
  const object = scene.objectAt(x, y);
  const hint = element("hint");
  hint.hidden = !object;
  if (object) {
    hint.textContent = [
      `${inWords(object.kind ?? "object")} ${object.id ?? ""}`,
      Number.isFinite(object.speed) && `${fixed(object.speed, 1)} m/s`,
      Number.isFinite(object.length) && Number.isFinite(object.width)
        && `${fixed(object.length, 1)} × ${fixed(object.width, 1)} m`,
      object.unseen > 0 && `unseen for ${fixed(object.unseen, 1)} s`,
    ].filter(Boolean).join("\n");
    hint.style.left = `${Math.min(x + 12, scene.width - 110)}px`;
    hint.style.top = `${Math.min(y + 12, scene.height - 70)}px`;
  }
}

function listenToKeys() {
  const keys = {
    " ": () => setPlaying(!isPlaying),
    ArrowLeft: (event) => seek(time - (event.shiftKey ? 1 : 0.1)),
    ArrowRight: (event) => seek(time + (event.shiftKey ? 1 : 0.1)),
    ArrowUp: () => changeRate(1),
    ArrowDown: () => changeRate(-1),
    Home: () => seek(0),
    End: () => seek(drive.duration),
    "+": () => zoom(1.25),
    "=": () => zoom(1.25),
    "-": () => zoom(0.8),
    f: () => setFollow(!scene.camera.follows),
    h: () => setTurn(!scene.camera.turns),
    t: toggleTheme,
  };
  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const isOwn = event.target.matches?.("select, button, input[type=checkbox]")
      && (key === " " || event.target.matches("select"));
    if (event.ctrlKey || event.altKey || event.metaKey || isOwn || !keys[key]) {
      return;
    }
    event.preventDefault();
    keys[key](event);
  });
}

function listenToButtons() {
  const actions = {
    play: () => setPlaying(!isPlaying),
    begin: () => seek(0),
    back: () => seek(time - 0.1),
    forward: () => seek(time + 0.1),
    zoom_in: () => zoom(1.25),
    zoom_out: () => zoom(0.8),
    follow: () => setFollow(!scene.camera.follows),
    turn: () => setTurn(!scene.camera.turns),
    theme: toggleTheme,
  };
  for (const [id, action] of Object.entries(actions)) {
    element(id).addEventListener("click", action);
  }
  element("slider").max = drive.duration;
  element("slider").addEventListener("input", () => seek(Number(element("slider").value)));
}

element("title").textContent = document.title;
buildLayers();
buildEvents();
buildDifferences();
listenToPointers();
listenToKeys();
listenToButtons();
const prefersDark = matchMedia("(prefers-color-scheme: dark)");
setTheme(prefersDark.matches ? "dark" : "light");
prefersDark.addEventListener("change", () => setTheme(prefersDark.matches ? "dark" : "light"));
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
