// The lines of the run's log.
import { element, logRow, wordOf } from "../controls.js";
import { decode } from "./messages.js";
import { say } from "./rows.js";
import { bindFields } from "./view.js";

const MOST_LINES = 1000;
const MOST_SHOWN = 300;
const LEVELS = ["debug", "info", "warning", "error"];

export class Log {
  #end = null;
  #isDirty = false;

  constructor(connection, types, clock, layer) {
    Object.assign(this, { connection, types, clock, layer });
    this.lines = [];
    this.isShown = false;
    for (const id of ["log_level", "log_filter"]) {
      element(id).addEventListener("input", () => this.#show());
    }
  }

  // The topics of the run are known.
  update() {
    const channel = this.layer && this.connection.channels.get(this.layer.topic);
    say(element("log_problem"), channel ? "" : "This run does not publish its log. Name the topic to have it: "
      + "fastcycle run … --record-topics fastcycle/log, or \"record\": {\"topics\": [\"fastcycle/log\", …]}.");
    if (channel && !this.#end) {
      const type = this.types.of(channel);
      const pick = bindFields(this.layer.fields, type);
      this.#end = this.connection.subscribe(this.layer.topic, (ns, payload) => {
        const published = this.clock.take(ns);
        this.lines.push({ published, ...pick(decode(type, payload), () => 0) });
        if (this.lines.length > MOST_LINES + 100) {
          this.lines.splice(0, 100);
        }
        this.#isDirty = true;
      });
    }
  }

  setShown(isShown) {
    this.isShown = isShown;
    this.#show();
  }

  clear() {
    this.#end?.();
    this.#end = null;
    this.lines = [];
    this.#show();
  }

  // A recording was moved to another time.
  forget() {
    this.lines = [];
    this.#show();
  }

  // Called again and again.
  tick() {
    if (this.#isDirty && this.isShown) {
      this.#show();
    }
  }

  #show() {
    this.#isDirty = false;
    const least = LEVELS.indexOf(element("log_level").value);
    const wanted = element("log_filter").value.trim().toLowerCase();
    const shown = this.lines.filter(({ level, component, text }) => LEVELS.indexOf(wordOf(level)) >= least
      && `${component} ${text}`.toLowerCase().includes(wanted)).slice(-MOST_SHOWN);
    const box = element("log_box");
    const isAtEnd = box.scrollTop + box.clientHeight >= box.scrollHeight - 20;
    element("log").replaceChildren(...shown.map((line) => logRow(line)));
    if (isAtEnd) {
      box.scrollTop = box.scrollHeight;  // The newest stays in sight, unless somebody reads what is above.
    }
  }
}
