// Curves over the time of the drive.
import uPlot from "uplot";

import { axesOf, drawTime, rangeOf } from "./curves.js";
import { distance, fixed, lastNotAfter } from "./data.js";

const HEIGHT = 130;

// Where the last value is that there is, not behind `index`.
function lastThere(values, index) {
  while (index > 0 && (values[index] === null || values[index] === undefined)) {
    --index;
  }
  return index;
}

// From the smallest distance between the vehicle and a tracked box, at the times of these.
function gaps(drive) {
  const times = drive.layers.objects?.taken.filter((time) => time >= 0) ?? [];
  return [times, times.map((time) => {
    const ego = drive.egoAt(time);
    const least = !ego ? Infinity : drive.objectsAt(time).reduce(
      (before, object) => Math.min(before, distance(ego, object)), Infinity);
    return Number.isFinite(least) ? least : null;
  })];
}

function latency(layer) {
  return layer && [layer.published, layer.published.map((time, i) => 1000 * (time - layer.taken[i]))];
}

function columnOf(layer, name, times = layer?.published) {
  const values = layer?.column(name);
  return values && [times, values];
}

// The curves of a drive, and beside each that of the new drive, if there is one: [title, unit, digits,
// [[name, color, [times, values], dash], …]], without what the log does not have.
function curvesOf(drive) {
  const curves = curvesOfOne(drive);
  for (const [title, , , series] of drive.other ? curvesOfOne(drive.other) : []) {
    const same = curves.find(([name]) => name === title);
    same?.[3].push(...series.map(([name, , data], i) => [`${name} (new)`, "--new", data, [[6, 3], [2, 3], [1, 5]][i % 3]]));
  }
  return curves;
}

function curvesOfOne(drive) {
  const { ego, plan, objects, predictions, command } = drive.layers;
  const planned = plan?.column("nominal")?.map((points) => points?.[0]?.[2] ?? null);
  return [
    ["speed", "m/s", 1, [
      ["vehicle", "--ego", columnOf(ego, "speed", ego?.taken)],
      ["plan", "--plan", planned && [plan.published, planned]]]],
    ["gap", "m", 1, [
      ["nearest", "--object", objects && ego && gaps(drive)],
      ["of the plan", "--plan", columnOf(plan, "gap")]]],
    ["latency since the measurement", "ms", 0, [
      ["objects", "--object", latency(objects)],
      ["predictions", "--prediction", latency(predictions)],
      ["plan", "--plan", latency(plan)]]],
    ["acceleration", "m/s²", 2, [
      ["vehicle", "--ego", columnOf(ego, "acceleration", ego?.taken)],
      ["command", "--plan", columnOf(command, "acceleration")]]],
  ].map(([title, unit, digits, series]) => [title, unit, digits, series.filter(([, , data]) => data)])
    .filter(([, , , series]) => series.length > 0);
}

export class Plots {
  constructor(box, drive, seek) {
    this.box = box;
    this.drive = drive;
    this.seek = seek;
    this.time = 0;
    this.curves = curvesOf(drive);
    this.plots = [];
  }

  // Anew, in the colors of now.
  build(color) {
    this.plots.forEach((plot) => plot.destroy());
    this.box.replaceChildren();
    this.plots = this.curves.map((curves) => this.#plot(curves, color));
    this.resize();
  }

  resize() {
    const width = this.box.clientWidth;
    for (const plot of this.plots) {
      if (plot.width !== width) {
        plot.setSize({ width, height: HEIGHT });
      }
    }
  }

  show(time) {
    this.time = time;
    for (const plot of this.plots) {
      const index = Math.max(0, lastNotAfter(plot.data[0], time));
      plot.setLegend({ idxs: plot.data.map((values) => lastThere(values, index)) });
      plot.redraw(false, false);
    }
  }

  #plot([title, unit, digits, series], color) {
    const data = uPlot.join(series.map(([, , [times, values]]) => [times, values]));
    const place = document.createElement("div");
    place.className = "plot";
    this.box.append(place);
    const options = {
      title: `${title}, ${unit}`,
      width: this.box.clientWidth || 300,
      height: HEIGHT,
      cursor: { sync: { key: "drive" }, drag: { x: false, y: false } },
      legend: { live: true },
      scales: { x: { time: false, range: [0, this.drive.duration] },
                y: { range: rangeOf(digits) } },
      axes: axesOf(color),
      series: [
        { label: "time", value: (_, time) => (time === null || time === undefined ? "" : `${time.toFixed(2)} s`) },
        ...series.map(([label, stroke, , dash]) => ({
          label, stroke: color(stroke), width: 1.5, dash, spanGaps: true, points: { show: false },
          value: (_, value) => (value === null || value === undefined ? "" : fixed(value, digits)),
        })),
      ],
      hooks: { draw: [(plot) => drawTime(plot, this.time, color("--text"))] },
    };
    const plot = new uPlot(options, data, place);
    plot.over.addEventListener("click", (event) => {
      this.seek(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
    });
    return plot;
  }
}
