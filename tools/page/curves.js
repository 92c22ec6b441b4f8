// How curves over time look.
import uPlot from "uplot";

// Of the axis of values: never narrower than twenty steps of the last digit, so that a curve that does
// not change is a line in the middle.
export function rangeOf(digits) {
  const least = 10 ** (1 - digits);
  return (_, low, high) => {
    if (low === null) {
      return [0, least];
    }
    const middle = (low + high) / 2;
    return high - low < least ? [middle - least, middle + least]
                              : uPlot.rangeNum(low, high, 0.1, true);
  };
}

export function axesOf(color) {
  const axis = { stroke: color("--soft"), grid: { stroke: color("--line"), width: 1 },
                 ticks: { stroke: color("--line"), width: 1, size: 4 }, font: "10px system-ui" };
  return [{ ...axis, size: 24, values: (_, times) => times.map((time) => `${time} s`) },
          { ...axis, size: 42, space: 24 }];
}

// A line across the plot at the time that is shown.
export function drawTime(plot, time, color) {
  const x = Math.round(plot.valToPos(time, "x", true));
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = color;
  ctx.lineWidth = devicePixelRatio;
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  ctx.restore();
}
