// What the run says of itself once a second, and what grew since the time before.

const PERIOD_MS = 1000;
const NS = 1e9;

const growth = (now, before, name) => (before ? Number(now[name]) - Number(before[name]) : NaN);

export class Overview {
  #last = null;
  #timer = null;

  // `changed` is called when there is something new to show, or to say.
  constructor(connection, changed) {
    this.connection = connection;
    this.changed = changed;
    this.clear();
  }

  clear() {
    this.#last = null;
    this.problem = "";
    this.isThere = false;
    this.allow = new Set();
    this.components = new Map();
    this.topics = new Map();
    this.services = [];
    this.modes = [];
    this.mode = "";
    this.documents = [];
  }

  start() {
    this.stop();
    this.#timer = setInterval(() => this.poll(), PERIOD_MS);
    this.poll();
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = null;
  }

  async poll() {
    if (this.asks || document.visibilityState === "hidden") {
      return;
    }
    this.asks = true;
    try {
      this.#take(await this.connection.ask({ overview: {} }, "overview"));
      this.problem = "";
    } catch (error) {
      this.problem = error.message;
    } finally {
      this.asks = false;
    }
    this.changed();
  }

  #take(given) {
    const overview = { components: [], topics: [], services: [], allow: [], modes: [], documents: [], ...given };
    const before = this.#last;
    const seconds = before ? growth(overview, before.overview, "monotonic_ns") / NS : NaN;
    const perSecond = (now, then, name) => (seconds > 0 ? growth(now, then, name) / seconds : NaN);
    const components = new Map(overview.components.map((one) => [one.name, one]));
    const topics = new Map(overview.topics.map((one) => [one.name, one]));
    this.components = new Map(overview.components.map((one) => {
      const then = before?.components.get(one.name);
      return [one.name, { ...one, hz: perSecond(one, then, "activations"), cpu: perSecond(one, then, "busy_ns") / NS }];
    }));
    this.topics = new Map(overview.topics.map((one) => {
      const then = before?.topics.get(one.name);
      return [one.name, { ...one, hz: perSecond(one, then, "published"), dropsHz: perSecond(one, then, "dropped") }];
    }));
    this.#last = { overview, components, topics };
    this.isThere = true;
    this.services = overview.services;
    this.allow = new Set(overview.allow);
    this.mode = overview.mode;
    this.modes = overview.modes;
    this.documents = overview.documents;
  }

  // Why something cannot be done; empty if it can.
  whyNot(word) {
    return this.allow.has(word) ? "" : `Not allowed by the run: --inspect-allow ${word}`;
  }
}

export function rate(hz) {
  return !Number.isFinite(hz) ? "–" : hz >= 100 ? `${Math.round(hz)}/s` : `${hz.toFixed(1)}/s`;
}

export function duration(ns) {
  const number = Number(ns);
  return !Number.isFinite(number) ? "–" : number >= 1e9 ? `${(number / 1e9).toFixed(2)} s`
    : number >= 1e6 ? `${(number / 1e6).toFixed(1)} ms` : `${(number / 1e3).toFixed(0)} µs`;
}

// "–" where nothing was measured.
export const quantile = (histogram, name) => (Number(histogram?.count) > 0 ? duration(histogram[name]) : "–");

// good, careful, bad or idle: how a component is.
export function meaningOf({ state, health }) {
  return health === "failed" || health === "hangs" ? "bad" : health === "degraded" ? "careful"
    : state === "active" || state === "replayed" ? "good" : "idle";
}
