// The drive of a run: its layers grow with the messages of the topics that a view names, and forget what is older
// than a minute.
import { Drive, GrowingLayer } from "../data.js";
import { decode } from "./messages.js";
import { bindFields } from "./view.js";

export const KEPT_S = 60;
// Those between two messages of which something is drawn; all others are read when they are drawn.
const PLACED = ["ego", "objects", "points"];
// What is drawn of which layer of the view; a layer is asked for while one of these is shown. Those that are not here
// are asked for always, but for what is drawn nowhere.
const SHOWN_AS = {
  lanes: ["lanes"], route: ["route"], goal: ["goal"], points: ["points"], borders: ["borders"],
  predictions: ["predictions"], plan: ["plan", "minimal_risk"], objects: ["objects", "unknown", "velocity"],
};
const NOT_DRAWN = ["command", "log"];

export class LiveDrive {
  #ends = new Map();  // By layer: what ends its subscription.

  // `isShown` says whether a layer of the scene is shown; `grown` is called with the time of each message.
  constructor(view, connection, types, clock, isShown) {
    this.view = view;
    this.connection = connection;
    this.types = types;
    this.clock = clock;
    this.isShown = isShown;
    this.problems = {};  // By layer: why it is not shown.
    this.messages = 0;
    this.drive = new Drive({ duration: 0, constants: view.constants ?? {}, layers: {} });
  }

  // The topics of the run are known, and what is shown may have changed.
  update() {
    for (const [name, layer] of Object.entries(this.view.layers)) {
      const channel = this.connection.channels.get(layer.topic);
      const isWanted = channel && !NOT_DRAWN.includes(name)
        && (SHOWN_AS[name]?.some((shown) => this.isShown(shown)) ?? true);
      if (isWanted && !this.#ends.has(name)) {
        this.#begin(name, layer, channel);
      } else if (!isWanted && this.#ends.has(name)) {
        this.#ends.get(name)();
        this.#ends.delete(name);
        if (channel) this.drive.layers[name]?.clear();  // What was shown long ago is not shown as if it was now.
      }
      if (channel && !this.drive.layers[name] && !NOT_DRAWN.includes(name)) {
        this.drive.layers[name] = new GrowingLayer(layer.topic);
      }
    }
  }

  // Another run: nothing of the one before holds.
  clear() {
    this.#ends.forEach((end) => end());
    this.#ends.clear();
    this.drive.layers = {};
    this.problems = {};
    this.messages = 0;
  }

  // A recording was moved to another time: what was drawn may be of a time behind it.
  forget() {
    Object.values(this.drive.layers).forEach((layer) => layer.clear());
  }

  #begin(name, { topic, fields, most_hz }, channel) {
    let type;
    let pick;
    try {
      type = this.types.of(channel);
      pick = bindFields(fields, type);
    } catch (error) {
      this.problems[name] = `${name} (${topic}): ${error.message}`;
      this.#ends.set(name, () => {});
      return;
    }
    const layer = new GrowingLayer(topic);
    this.drive.layers[name] = layer;
    const period = most_hz ? 0.9 / most_hz : 0;
    const toTime = (ns) => this.clock.toTime(ns);
    this.#ends.set(name, this.connection.subscribe(topic, (ns, payload) => {
      const published = this.clock.take(ns);
      ++this.messages;
      if (layer.count > 0 && published - layer.published.at(-1) < period) {
        return;
      }
      let make = () => this.#read(name, () => pick(decode(type, payload), toTime));
      let taken = published;
      if (PLACED.includes(name)) {
        const object = { published, ...make() };
        make = object;
        taken = object.time ?? published;
      }
      layer.add(published, taken, make);
      layer.forget(this.clock.newest - KEPT_S);
    }));
  }

  // A message that cannot be read takes no other with it.
  #read(name, read) {
    try {
      return read();
    } catch (error) {
      this.problems[name] ??= `${name}: ${error.message}`;
      return {};
    }
  }
}

// The page's time: seconds since the first message that came, of the application's clock.
export class Clock {
  #zero = null;
  newest = 0;

  // A time in nanoseconds that messages have.
  toTime(ns) {
    return this.#zero === null ? 0 : Number(BigInt.asIntN(64, ns - this.#zero)) / 1e9;
  }
  // That of a message that came now.
  take(ns) {
    this.#zero ??= ns;
    const time = this.toTime(ns);
    // Latched messages are older than what came first.
    this.newest = Math.max(this.newest, time);
    return time;
  }
  // Times count from `ns` on.
  begin(ns) {
    this.#zero = ns;
  }
  get isSet() {
    return this.#zero !== null;
  }
  clear() {
    this.#zero = null;
    this.newest = 0;
  }
}
