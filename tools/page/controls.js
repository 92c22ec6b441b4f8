// What one can do with the scene, and what stands beside it: the same for a drive of a log and for one that runs.
import { fixed, inWords } from "./data.js";
import { LAYERS } from "./scene.js";

export const element = (id) => document.getElementById(id);

// An element with these properties and children. Names with "-" and `role` are attributes.
export function make(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role") {
      made.setAttribute(name, value);
    } else {
      made[name] = value;
    }
  }
  made.append(...children);
  return made;
}

export class SceneControls {
  // `changed` is called when the scene has to be drawn again.
  constructor(scene, changed) {
    this.scene = scene;
    this.changed = changed;
    this.keys = {
      "+": () => this.zoom(1.25),
      "=": () => this.zoom(1.25),
      "-": () => this.zoom(0.8),
      f: () => this.setFollow(!scene.camera.follows),
      h: () => this.setTurn(!scene.camera.turns),
    };
    this.buttons = { zoom_in: this.keys["+"], zoom_out: this.keys["-"], follow: this.keys.f, turn: this.keys.h };
    this.#listenToPointers();
  }

  setFollow(follows) {
    this.scene.camera.follows = follows;
    element("follow").setAttribute("aria-pressed", follows);
    this.changed();
  }

  setTurn(turns) {
    this.scene.camera.turns = turns;
    element("turn").setAttribute("aria-pressed", turns);
    this.changed();
  }

  zoom(factor, ...place) {
    this.scene.zoom(factor, ...place);
    this.changed();
  }

  #listenToPointers() {
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
        this.#showHint(...place(event));
        return;
      }
      const before = middle();
      pointers.set(event.pointerId, place(event));
      const after = middle();
      if (before.x !== after.x || before.y !== after.y) {
        this.scene.pan(before.x, before.y, after.x, after.y);
        this.setFollow(false);
      }
      if (before.reach > 0 && after.reach > 0) {
        this.zoom(after.reach / before.reach, after.x, after.y);
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => {
        pointers.delete(event.pointerId);
        this.#showHint(...place(event));
      });
    }
    canvas.addEventListener("pointerleave", () => (element("hint").hidden = true));
    canvas.addEventListener("dblclick", () => this.setFollow(true));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500), ...place(event));
    }, { passive: false });
  }

  #showHint(x, y) {
    const object = this.scene.objectAt(x, y);
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
      hint.style.left = `${Math.min(x + 12, this.scene.width - 110)}px`;
      hint.style.top = `${Math.min(y + 12, this.scene.height - 70)}px`;
    }
  }
}

// A box to check for each layer that there is. `changed` receives which one is shown or not.
export function buildLayers(scene, has, changed) {
  element("layers").replaceChildren();
  for (const [name, text, color] of LAYERS) {
    if (!has(name)) continue;
    const box = make("input", { type: "checkbox", checked: scene.shown[name], id: `show_${name}` });
    box.addEventListener("change", () => {
      scene.shown[name] = box.checked;
      changed(name);
    });
    const sign = make("i");
    sign.style.background = `var(${color})`;
    element("layers").append(make("label", {}, box, sign, text));
  }
}

// Actions by key. Where a key means something to what has the focus, it keeps that meaning.
export function listenToKeys(keys) {
  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const isWritten = event.target.matches?.("input:not([type=checkbox], [type=range]), textarea");
    const isScrolled = event.target.matches?.("[data-scrolls]") && /^(Arrow|Home|End)/.test(key);
    const isOwn = event.target.matches?.("select, button, summary, input[type=checkbox], [role=button]")
      && (key === " " || event.target.matches("select"));
    if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey || isWritten || isScrolled || isOwn
        || !keys[key]) {
      return;
    }
    event.preventDefault();
    keys[key](event);
  });
}

export function listenToButtons(actions) {
  for (const [id, action] of Object.entries(actions)) {
    element(id).addEventListener("click", action);
  }
}

// Light or dark: as the system has it, until somebody wants it another way. `changed` is called with each change.
export class Theme {
  constructor(changed) {
    this.changed = changed;
    const prefersDark = matchMedia("(prefers-color-scheme: dark)");
    const follow = () => this.set(prefersDark.matches ? "dark" : "light");
    prefersDark.addEventListener("change", follow);
    follow();
  }
  set(theme) {
    document.documentElement.dataset.theme = theme;
    this.changed();
  }
  toggle() {
    this.set(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  }
}

export function showState(drive, time) {
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
}

export function showReadout(drive, scene, time) {
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

// "warning" of LOG_LEVEL_WARNING.
export const wordOf = (level) => String(level).replace("LOG_LEVEL_", "").toLowerCase();

// A line of the log, as a row of a table.
export function logRow({ published, level, component, text, lost }) {
  const word = wordOf(level);
  const words = [`${published.toFixed(2)} s`, word, component, lost > 0 ? `(${lost} lines are missing) ${text}` : text];
  return make("tr", { className: word }, ...words.map((one) => make("td", { textContent: one })));
}
