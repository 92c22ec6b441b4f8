// Curves of fields of messages over the last minute. A topic is subscribed to as long as one of its fields is drawn.
import uPlot from "uplot";

import { element, make } from "../controls.js";
import { axesOf, drawTime, rangeOf } from "../curves.js";
import { lastNotAfter } from "../data.js";
import { KEPT_S } from "./drive.js";
import { decode, nameOfPath, numberAt } from "./messages.js";
import { say } from "./rows.js";

const HEIGHT = 120;
const PERIOD_MS = 100;  // They are drawn so often at most.
const MOST_VALUES = 12_000;  // Of a curve.
const COLORS = ["--ego", "--object", "--plan", "--prediction", "--risk", "--points", "--goal", "--velocity"];
const DRAG = "application/x-fastcycle-field";

class Curve {
  constructor(topic, path) {
    this.topic = topic;
    this.path = path;
    this.name = `${topic} ${nameOfPath(path)}`;
    this.times = [];
    this.values = [];
  }
  add(time, value) {
    if (value === null || time <= (this.times.at(-1) ?? -Infinity)) {
      return;
    }
    this.times.push(time);
    this.values.push(value);
    const old = Math.max(lastNotAfter(this.times, time - KEPT_S), this.times.length - MOST_VALUES);
    if (old > this.times.length / 8) {
      this.times.splice(0, old);
      this.values.splice(0, old);
    }
  }
}

export class LivePlots {
  #topics = new Map();  // By topic: what ends its subscription.
  #last = -Infinity;

  // `seek(time)` is called for a click in a curve; `color` gives that of a name.
  constructor(connection, types, clock, seek, color) {
    Object.assign(this, { connection, types, clock, seek, color });
    this.plots = [];
    this.nextNumber = 1;
    const zone = element("plot_zone");
    this.#listenToDrops(zone, () => null);
    this.#showTargets();
  }

  #listenToDrops(place, plotOf) {
    place.addEventListener("dragover", (event) => {
      if (event.dataTransfer.types.includes(DRAG)) {
        event.preventDefault();
        place.classList.add("over");
      }
    });
    place.addEventListener("dragleave", () => place.classList.remove("over"));
    place.addEventListener("drop", (event) => {
      place.classList.remove("over");
      const text = event.dataTransfer.getData(DRAG);
      if (text) {
        event.preventDefault();
        event.stopPropagation();
        const { topic, path } = JSON.parse(text);
        this.add(topic, path, plotOf());
      }
    });
  }

  // Into the plot that the page's choice says, if none is given.
  addToChosen(topic, path) {
    const chosen = element("plot_target").value;
    this.add(topic, path, this.plots.find(({ number }) => String(number) === chosen) ?? null);
  }

  // Into `plot`; null: a new one.
  add(topic, path, plot) {
    const into = plot ?? this.#newPlot();
    if (!into.curves.some((curve) => curve.name === new Curve(topic, path).name)) {
      into.curves.push(new Curve(topic, path));
      this.#build(into);
      this.#subscribe();
    }
    this.#showTargets();
    say(element("plot_said"), `${topic} ${nameOfPath(path)} is drawn in plot ${into.number}.`);
  }

  #newPlot() {
    const plot = { number: this.nextNumber++, curves: [], chart: null };
    plot.place = make("div", { className: "plot" });
    plot.legend = make("ul", { className: "curves", "aria-label": `Curves of plot ${plot.number}` });
    plot.box = make("div", { className: "plot_box" },
      make("div", { className: "plot_head" }, make("h3", { textContent: `plot ${plot.number}` }), plot.legend), plot.place);
    this.#listenToDrops(plot.box, () => plot);
    element("plots").append(plot.box);
    this.plots.push(plot);
    return plot;
  }

  #remove(plot, curve) {
    plot.curves = plot.curves.filter((one) => one !== curve);
    if (plot.curves.length === 0) {
      plot.chart?.destroy();
      plot.box.remove();
      this.plots = this.plots.filter((one) => one !== plot);
      element("plot_target").focus();
    } else {
      this.#build(plot);
      plot.legend.querySelector("button").focus();
    }
    this.#subscribe();
    this.#showTargets();
    say(element("plot_said"), `${curve.name} is taken away.`);
  }

  #showTargets() {
    const select = element("plot_target");
    const chosen = select.value;
    select.replaceChildren(make("option", { value: "new", textContent: "a new plot" }),
      ...this.plots.map(({ number }) => make("option", { value: String(number), textContent: `plot ${number}` })));
    select.value = [...select.options].some(({ value }) => value === chosen) ? chosen : "new";
    element("plot_zone").classList.toggle("empty", this.plots.length === 0);
  }

  #subscribe() {
    const wanted = new Set(this.plots.flatMap(({ curves }) => curves.map(({ topic }) => topic)));
    for (const [topic, end] of this.#topics) {
      if (!wanted.has(topic)) {
        end();
        this.#topics.delete(topic);
      }
    }
    for (const topic of wanted) {
      if (!this.#topics.has(topic)) {
        this.#topics.set(topic, this.connection.subscribe(topic, (ns, payload) => this.#take(topic, ns, payload)));
      }
    }
  }

  #take(topic, ns, payload) {
    const time = this.clock.take(ns);
    try {
      const type = this.types.of(this.connection.channels.get(topic));
      const message = decode(type, payload);
      for (const { curves } of this.plots) {
        curves.forEach((curve) => curve.topic === topic && curve.add(time, numberAt(message, type, curve.path)));
      }
    } catch (error) {
      say(element("plot_said"), `${topic} cannot be drawn: ${error.message}`);
    }
  }

  // Another run: what was drawn of the one before has other times.
  clear() {
    this.plots.forEach(({ curves }) => curves.forEach((curve) => (curve.times.length = curve.values.length = 0)));
  }

  // Anew, in the colors of now.
  buildAll() {
    this.plots.forEach((plot) => this.#build(plot));
  }

  #build(plot) {
    plot.chart?.destroy();
    const { color } = this;
    plot.legend.replaceChildren(...plot.curves.map((curve, i) => {
      const sign = make("i");
      sign.style.background = `var(${COLORS[i % COLORS.length]})`;
      curve.now = make("output");
      const button = make("button", { type: "button", textContent: "×", title: "Take it away", "aria-label": `take ${curve.name} away` });
      button.addEventListener("click", () => this.#remove(plot, curve));
      return make("li", {}, sign, make("span", { textContent: curve.name }), curve.now, button);
    }));
    plot.chart = new uPlot({
      width: plot.place.clientWidth || 300,
      height: HEIGHT,
      cursor: { sync: { key: "live" }, drag: { x: false, y: false } },
      legend: { show: false },
      scales: {
        x: { time: false, range: () => [Math.max(0, this.clock.newest - KEPT_S), Math.max(1, this.clock.newest)] },
        y: { range: rangeOf(3) },
      },
      axes: axesOf(color),
      series: [{}, ...plot.curves.map((_, i) => ({
        stroke: color(COLORS[i % COLORS.length]), width: 1.5, spanGaps: true, points: { show: false } }))],
      hooks: { draw: [(chart) => drawTime(chart, this.time, color("--text"))] },
    }, this.#data(plot), plot.place);
    plot.chart.over.addEventListener("click", (event) => {
      this.seek(plot.chart.posToVal(event.clientX - plot.chart.over.getBoundingClientRect().left, "x"));
    });
  }

  #data({ curves }) {
    return uPlot.join(curves.map(({ times, values }) => [times, values]));
  }

  // Of the time that is shown; not more often than one can see.
  show(time) {
    const now = performance.now();
    this.time = time;
    if (now - this.#last < PERIOD_MS) {
      return;
    }
    this.#last = now;
    for (const plot of this.plots) {
      const width = plot.place.clientWidth;
      if (width > 0 && plot.chart.width !== width) {
        plot.chart.setSize({ width, height: HEIGHT });
      }
      plot.chart.setData(this.#data(plot));
      for (const { now: output, times, values } of plot.curves) {
        const index = lastNotAfter(times, time);
        say(output, index < 0 ? "" : String(Number(values[index].toPrecision(5))));
      }
    }
  }
}
