// Who publishes what for whom: a box for each component, and on each edge the topic with its rate and latency.
import dagre from "@dagrejs/dagre";

import { element, make } from "../controls.js";
import { lifecycleButtons } from "./components.js";
import { duration, meaningOf, quantile, rate } from "./overview.js";
import { say } from "./rows.js";

const SVG = "http://www.w3.org/2000/svg";
const BOX = [196, 58];
const LINE = 14;
const LEAST_SCALE = 0.4;
const MOST_SCALE = 2;

function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
  made.append(...children);
  return made;
}

// [component or topic, component or topic] pairs; topics that nobody subscribes to are in the list of topics.
function edgesOf(topics) {
  const edges = [];
  for (const { name, publishers, subscribers } of topics) {
    if (publishers.length > 0 && subscribers.length > 0) {
      publishers.forEach((component) => edges.push({ topic: name, component, isPublisher: true }));
      subscribers.forEach((component) => edges.push({ topic: name, component, isPublisher: false }));
    }
  }
  return edges;
}

const unique = (names) => [...new Set(names)];

export class Graph {
  constructor(connection, overview) {
    this.connection = connection;
    this.overview = overview;
    this.known = null;  // By topic and component, from the WebSocket: all there is where questions are not answered.
    this.structure = "";
    this.scale = 1;
    this.selected = null;
    this.boxes = new Map();
    this.pills = new Map();
    this.pen = document.createElement("canvas").getContext("2d");
    this.pen.font = "11px system-ui, sans-serif";
    element("graph_closer").addEventListener("click", () => this.#zoom(1.25));
    element("graph_farther").addEventListener("click", () => this.#zoom(0.8));
    element("graph_fit").addEventListener("click", () => this.fit());
  }

  takeConnections({ publishedTopics, subscribedTopics, removedTopics }) {
    this.known ??= { published: new Map(), subscribed: new Map() };
    publishedTopics.forEach(({ name, publisherIds }) => this.known.published.set(name, publisherIds));
    subscribedTopics.forEach(({ name, subscriberIds }) => this.known.subscribed.set(name, subscriberIds));
    (removedTopics ?? []).forEach((name) => this.known.published.delete(name));
  }

  clear() {
    this.known = null;
    this.selected = null;
    element("details").replaceChildren();
  }

  #topics() {
    if (this.overview.isThere) {
      return [...this.overview.topics.values()].filter((topic) => !topic.is_service).map((topic) => ({
        name: topic.name,
        publishers: unique((topic.publishers ?? []).map(({ component }) => component)),
        subscribers: unique((topic.subscribers ?? []).filter(({ kind }) => kind !== "tap").map(({ component }) => component)),
      }));
    }
    return [...this.known?.published ?? []].map(([name, publishers]) => (
      { name, publishers, subscribers: this.known.subscribed.get(name) ?? [] }));
  }

  update() {
    const topics = this.#topics();
    const edges = edgesOf(topics);
    const components = this.overview.isThere ? [...this.overview.components.keys()]
      : unique(edges.map(({ component }) => component));
    say(element("graph_problem"), this.overview.problem);
    const structure = JSON.stringify([components, edges]);
    if (structure !== this.structure) {
      this.structure = structure;
      this.#build(components, edges);
    }
    this.#fill();
    this.#fillDetails();
  }

  #widthOf(text) {
    return Math.ceil(this.pen.measureText(text).width);
  }

  #build(components, edges) {
    const layout = new dagre.graphlib.Graph();
    layout.setGraph({ rankdir: "TB", nodesep: 14, ranksep: 18, edgesep: 8, marginx: 10, marginy: 10 });
    layout.setDefaultEdgeLabel(() => ({}));
    components.forEach((name) => layout.setNode(`c ${name}`, { width: BOX[0], height: BOX[1] }));
    for (const topic of unique(edges.map((edge) => edge.topic))) {
      layout.setNode(`t ${topic}`, { width: Math.max(96, this.#widthOf(topic) + 18), height: 34 });
    }
    for (const { topic, component, isPublisher } of edges) {
      const [from, to] = [`c ${component}`, `t ${topic}`];
      layout.setEdge(...isPublisher ? [from, to] : [to, from]);
    }
    dagre.layout(layout);

    const { width, height } = layout.graph();
    this.size = components.length > 0 ? [width, height] : [100, 100];
    const place = element("graph");
    const lines = layout.edges().map((edge) => {
      const isToComponent = edge.v.startsWith("t ");
      const [topic, component] = (isToComponent ? [edge.v, edge.w] : [edge.w, edge.v]).map((id) => id.slice(2));
      return svg("path", { d: pathThrough(layout.edge(edge).points), class: "edge", "data-topic": topic, "data-component": component,
                           ...isToComponent ? { "marker-end": "url(#arrow)" } : {} });
    });
    this.boxes.clear();
    this.pills.clear();
    const nodes = layout.nodes().map((id) => {
      const name = id.slice(2);
      const { x, y, width: wide, height: high } = layout.node(id);
      const isComponent = id.startsWith("c ");
      const texts = Array.from({ length: isComponent ? 3 : 2 }, (_, i) =>
        svg("text", { x: isComponent ? 14 : wide / 2, y: (isComponent ? 18 : 14) + i * LINE }));
      const group = svg("g", { class: isComponent ? "component" : "topic", transform: `translate(${x - wide / 2},${y - high / 2})`,
                               tabindex: 0, role: "button", "data-name": name },
                        svg("rect", { class: "frame", width: wide, height: high, rx: isComponent ? 6 : 10 }),
                        ...isComponent ? [svg("rect", { class: "health", x: 4, y: 6, width: 4, height: high - 12, rx: 2 })] : [],
                        ...texts);
      texts[0].textContent = name;
      const select = () => this.select(isComponent ? "component" : "topic", name);
      group.addEventListener("click", select);
      group.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          select();
        }
      });
      (isComponent ? this.boxes : this.pills).set(name, { group, texts });
      return group;
    });
    place.replaceChildren(
      svg("defs", {}, svg("marker", { id: "arrow", viewBox: "0 0 8 8", refX: 7, refY: 4, markerWidth: 6, markerHeight: 6,
                                markerUnits: "userSpaceOnUse", orient: "auto" },
                          svg("path", { d: "M0 0 L8 4 L0 8 z", class: "head" }))),
      ...lines, ...nodes);
    place.setAttribute("viewBox", `0 0 ${this.size[0]} ${this.size[1]}`);
    this.fit();
  }

  // As wide as there is room, as long as its words can be read.
  fit() {
    const room = element("graph_box").clientWidth - 4;
    if (room > 0 && this.size) {
      this.#setScale(Math.max(0.7, Math.min(1, room / this.size[0])));
      element("graph_box").scrollLeft = (this.size[0] * this.scale - room) / 2;
    }
  }

  #zoom(factor) {
    this.#setScale(Math.min(MOST_SCALE, Math.max(LEAST_SCALE, this.scale * factor)));
  }

  #setScale(scale) {
    this.scale = scale;
    element("graph").setAttribute("width", this.size[0] * scale);
    element("graph").setAttribute("height", this.size[1] * scale);
  }

  #fill() {
    for (const [name, { group, texts }] of this.boxes) {
      const one = this.overview.components.get(name);
      if (one) {
        group.dataset.meaning = meaningOf(one);
        say(texts[1], `${one.state} · ${one.health}`);
        say(texts[2], `${rate(one.hz)} · p99 ${quantile(one.callback, "p99_ns")} · ${one.faults} faults`);
        group.setAttribute("aria-label", `Component ${name}: ${texts[1].textContent}, ${texts[2].textContent}`);
      }
    }
    for (const [name, { group, texts }] of this.pills) {
      const one = this.overview.topics.get(name);
      if (one) {
        say(texts[1], `${rate(one.hz)} · ${quantile(one.latency, "p99_ns")}`);
        group.classList.toggle("drops", one.dropsHz > 0);
        group.setAttribute("aria-label", `Topic ${name}: ${texts[1].textContent}`);
      }
    }
  }

  select(kind, name) {
    this.selected = { kind, name };
    for (const [map, its] of [[this.boxes, "component"], [this.pills, "topic"]]) {
      map.forEach(({ group }, one) => group.classList.toggle("selected", its === kind && one === name));
    }
    element("graph").querySelectorAll(".edge").forEach((path) => path.classList.toggle("selected", path.dataset[kind] === name));
    this.facts = make("dl");
    this.buttons = kind === "component" ? lifecycleButtons(name, this.connection, this.overview) : null;
    element("details").replaceChildren(make("h3", { textContent: name }), ...this.buttons ? [this.buttons] : [], this.facts);
    this.#fillDetails();
    element("details").scrollIntoView({ block: "nearest" });
  }

  #fillDetails() {
    if (!this.selected) {
      return;
    }
    const { kind, name } = this.selected;
    const one = (kind === "component" ? this.overview.components : this.overview.topics).get(name);
    if (!one) {
      return;
    }
    this.buttons?.update();
    const facts = kind === "component" ? factsOfComponent(one) : factsOfTopic(one);
    this.facts.replaceChildren(...facts.filter(([, text]) => text !== "").flatMap(([word, text]) => [
      make("dt", { textContent: word }), make("dd", { textContent: text })]));
  }
}

function factsOfComponent(one) {
  const times = (histogram) => (Number(histogram?.count) > 0
    ? `p50 ${duration(histogram.p50_ns)}, p99 ${duration(histogram.p99_ns)}, largest ${duration(histogram.max_ns)}` : "–");
  return [
    ["state", `${one.state}, ${one.health}`], ["why", one.health_reason], ["last fault", one.last_fault],
    ["library", one.library], ["executor", one.executor],
    ["activations", `${one.activations}, ${rate(one.hz)}`],
    ["CPU", Number.isFinite(one.cpu) ? `${(100 * one.cpu).toFixed(1)} %` : "–"],
    ["faults", `${one.faults}, restarted ${one.restarts} times`],
    ["ticks left out", String(one.overruns)], ["messages that wait", String(one.queued)],
    ["callbacks take", times(one.callback)], ["timers are late", times(one.lateness)],
    ...(one.callbacks ?? []).map((callback) => [`${callback.kind} ${callback.name}`, times(callback.time)]),
  ];
}

function factsOfTopic(one) {
  return [
    ["type", one.type],
    ["messages", `${one.published}, ${rate(one.hz)}`],
    ["dropped", String(one.dropped)],
    ...(one.publishers ?? []).map(({ component, published }) => ["from", `${component}: ${published} messages`]),
    ...(one.subscribers ?? []).map(({ component, kind, depth, ledger, latency }) => ["to",
      `${component} (${kind}, ${depth}): ${ledger?.delivered ?? 0} delivered, `
      + `${(ledger?.drops ?? []).map(({ reason, count }) => `${count} ${reason}`).join(", ") || "none dropped"}`
      + `, p99 ${quantile(latency, "p99_ns")}`]),
  ];
}

// A line through these points, round where it bends.
function pathThrough(points) {
  const [first, ...others] = points;
  const last = others.pop();
  const at = ({ x, y }) => `${x.toFixed(1)} ${y.toFixed(1)}`;
  const between = (a, b) => at({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
  const bends = others.map((point, i) => `Q ${at(point)} ${i + 1 < others.length ? between(point, others[i + 1]) : at(last)}`);
  return `M ${at(first)} ${bends.length > 0 ? bends.join(" ") : `L ${at(last)}`}`;
}
