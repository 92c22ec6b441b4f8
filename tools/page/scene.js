// The drive seen from above, on a canvas.
import { fixed } from "./data.js";

export const LAYERS = [
  ["lanes", "lanes", "--edge"],
  ["route", "route", "--route"],
  ["goal", "goal", "--goal"],
  ["points", "lidar", "--points"],
  ["borders", "borders", "--border"],
  ["predictions", "predictions", "--prediction"],
  ["plan", "plan", "--plan"],
  ["minimal_risk", "minimal risk", "--risk"],
  ["unknown", "unknown", "--unknown"],
  ["objects", "objects", "--object"],
  ["velocity", "velocity", "--velocity"],
  ["new", "new drive", "--new"],
];

export const isUnknown = (object) => object.kind === "UNKNOWN";

const LABEL = [50, 12];  // As wide and high as the speed of an object, in pixels.
const LEAST_SCALE = 0.2;
const MOST_SCALE = 80;
const VELOCITY_S = 1;  // An arrow is as long as the way in this time.
const STANDS_MPS = 0.3;  // What is slower has neither an arrow nor a number.

export class Scene {
  constructor(canvas, drive) {
    this.canvas = canvas;
    this.drive = drive;
    this.context = canvas.getContext("2d");
    this.shown = Object.fromEntries(LAYERS.map(([name]) => [name, true]));
    this.camera = { x: 0, y: 0, scale: 6, angle: 0, follows: true, turns: false };
    this.objects = [];
    this.unknown = [];  // What nobody can name: bushes, walls, parts of things.
    this.readColors();
  }

  readColors() {
    const style = getComputedStyle(document.documentElement);
    this.color = (name) => style.getPropertyValue(name).trim();
    this.colors = Object.fromEntries(
      ["--ground", "--road", "--edge", "--route", "--ego", "--object", "--unknown", "--unseen", "--velocity", "--points", "--border",
       "--prediction", "--plan", "--risk", "--goal", "--new", "--text", "--soft"].map((name) => [name.slice(2), this.color(name)]));
  }

  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    this.width = width;
    this.height = height;
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(width * this.ratio));
    this.canvas.height = Math.max(1, Math.round(height * this.ratio));
  }

  // From the place in the window to the place in the map, and back.
  toMap(px, py) {
    const { x, y, scale, angle } = this.camera;
    const right = (px - this.width / 2) / scale;
    const up = (this.height / 2 - py) / scale;
    return [x + right * Math.cos(angle) - up * Math.sin(angle), y + right * Math.sin(angle) + up * Math.cos(angle)];
  }
  toWindow(mx, my) {
    const { x, y, scale, angle } = this.camera;
    const right = (mx - x) * Math.cos(angle) + (my - y) * Math.sin(angle);
    const up = (my - y) * Math.cos(angle) - (mx - x) * Math.sin(angle);
    return [this.width / 2 + right * scale, this.height / 2 - up * scale];
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const { camera } = this;
    const [x, y] = this.toMap(px, py);
    camera.scale = Math.min(MOST_SCALE, Math.max(LEAST_SCALE, camera.scale * factor));
    const [nowX, nowY] = this.toMap(px, py);
    if (!camera.follows) {
      camera.x += x - nowX;
      camera.y += y - nowY;
    }
  }

  pan(fromX, fromY, toX, toY) {
    const [ax, ay] = this.toMap(fromX, fromY);
    const [bx, by] = this.toMap(toX, toY);
    this.camera.follows = false;
    this.camera.x += ax - bx;
    this.camera.y += ay - by;
  }

  objectAt(px, py) {
    const [x, y] = this.toMap(px, py);
    const reach = 8 / this.camera.scale;
    return [...this.objects, ...this.unknown].find((object) => {
      const forward = (x - object.x) * Math.cos(object.heading) + (y - object.y) * Math.sin(object.heading);
      const left = (y - object.y) * Math.cos(object.heading) - (x - object.x) * Math.sin(object.heading);
      return Math.abs(forward) < object.length / 2 + reach && Math.abs(left) < object.width / 2 + reach;
    });
  }

  draw(time) {
    const { drive, context, camera, colors, shown } = this;
    const ego = drive.egoAt(time);
    if (ego && camera.turns) {
      camera.angle = ego.heading - Math.PI / 2;
    } else if (!camera.turns) {
      camera.angle = 0;
    }
    if (ego && camera.follows) {
      [camera.x, camera.y] = [ego.x, ego.y];
    }
    this.pixel = 1 / camera.scale;

    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.fillStyle = colors.ground;
    context.fillRect(0, 0, this.width, this.height);
    context.translate(this.width / 2, this.height / 2);
    context.scale(camera.scale, -camera.scale);
    context.rotate(-camera.angle);
    context.translate(-camera.x, -camera.y);
    context.lineJoin = context.lineCap = "round";

    const objects = drive.objectsAt(time);
    this.objects = objects.filter((object) => !isUnknown(object));
    this.unknown = objects.filter(isUnknown);
    if (shown.lanes) this.#lanes(drive.layers.lanes?.lastPublished(time));
    if (shown.route) this.#route(drive.layers.route?.lastPublished(time));
    if (shown.goal) this.#goal(drive.layers.goal?.lastPublished(time)?.place);
    if (shown.points) this.#points(drive.pointsAt(time));
    if (shown.borders) this.#borders(drive.bordersAt(time));
    if (shown.predictions) this.#predictions(drive.layers.predictions?.lastPublished(time));
    const plan = drive.layers.plan?.lastPublished(time);
    if (shown.plan) this.#way(plan?.nominal, colors.plan, 3, []);
    if (shown.minimal_risk) this.#way(plan?.minimal_risk, colors.risk, 2, [1.5, 1]);
    if (shown.unknown) this.unknown.forEach((object) => this.#outline(object, colors.unknown));
    if (shown.objects) this.objects.forEach((object) => this.#box(object, object.unseen > 0 ? colors.unseen : colors.object));
    if (shown.velocity) this.objects.forEach((object) => this.#velocity(object));
    if (ego) this.#box(ego, colors.ego);
    if (drive.other && shown.new) this.#other(drive.other, time);

    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    if (shown.objects) this.#labels();
    this.#yardstick();
  }

  // The new drive of a comparison, over the recorded one: all in one color, lines with gaps.
  #other(other, time) {
    const { shown, colors } = this;
    const plan = other.layers.plan?.lastPublished(time);
    if (shown.predictions) this.#predictions(other.layers.predictions?.lastPublished(time), colors.new);
    if (shown.plan) this.#way(plan?.nominal, colors.new, 2, [2, 1]);
    if (shown.minimal_risk) this.#way(plan?.minimal_risk, colors.new, 1.5, [0.7, 0.7]);
    if (shown.objects) other.objectsAt(time).forEach((object) => isUnknown(object) || this.#outline(object, colors.new));
    const ego = other.egoAt(time);
    if (ego) this.#outline(ego, colors.new);
  }

  // Through all places that are known.
  #line(xs, ys) {
    const { context } = this;
    context.beginPath();
    xs?.forEach((x, i) => Number.isFinite(x) && Number.isFinite(ys?.[i]) && context.lineTo(x, ys[i]));
  }

  #lanes(tile) {
    const { context, colors } = this;
    context.fillStyle = colors.road;
    for (const lane of tile?.lanes ?? []) {
      const { left_x = [], left_y = [], right_x = [], right_y = [] } = lane;
      this.#line([...left_x ?? [], ...[...right_x ?? []].reverse()], [...left_y ?? [], ...[...right_y ?? []].reverse()]);
      context.fill();
    }
    context.strokeStyle = colors.edge;
    context.lineWidth = Math.max(0.15, this.pixel);
    for (const lane of tile?.lanes ?? []) {
      this.#line(lane.left_x, lane.left_y);
      context.stroke();
      this.#line(lane.right_x, lane.right_y);
      context.stroke();
    }
  }

  #route(route) {
    if (!route) return;
    const { context, colors } = this;
    context.strokeStyle = colors.route;
    context.lineWidth = Math.max(0.5, 2 * this.pixel);
    context.globalAlpha = 0.6;
    this.#line(route.x, route.y);
    context.stroke();
    context.globalAlpha = 1;
  }

  // Where the vehicle is to come to.
  #goal(place) {
    if (!Number.isFinite(place?.x) || !Number.isFinite(place.y)) return;
    const { context, colors } = this;
    const { x, y, heading, length, width } = place;
    context.save();
    context.translate(x, y);
    context.rotate(heading);
    context.fillStyle = context.strokeStyle = colors.goal;
    context.globalAlpha = 0.15;
    context.fillRect(-length / 2, -width / 2, length, width);
    context.globalAlpha = 1;
    context.lineWidth = Math.max(0.15, 2 * this.pixel);
    context.strokeRect(-length / 2, -width / 2, length, width);
    context.beginPath();
    context.arc(0, 0, Math.hypot(length, width) / 2 + 6 * this.pixel, 0, 2 * Math.PI);
    context.stroke();
    context.restore();
  }

  #points(points) {
    if (!points) return;
    const { context, colors } = this;
    const size = Math.max(0.12, 1.6 * this.pixel);
    context.fillStyle = colors.points;
    for (let i = 0; i < points.length; i += 3) {
      context.globalAlpha = points[i + 2] > 0.3 ? 1 : 0.25;  // The ground is not what one looks for.
      context.fillRect(points[i] - size / 2, points[i + 1] - size / 2, size, size);
    }
    context.globalAlpha = 1;
  }

  #borders(borders) {
    const { context, colors } = this;
    context.fillStyle = colors.border;
    const size = Math.max(0.35, 3 * this.pixel);
    for (const [x, y] of borders) {
      context.fillRect(x - size / 2, y - size / 2, size, size);
    }
  }

  #predictions(predictions, color = this.colors.prediction) {
    const { context } = this;
    context.strokeStyle = color;
    context.lineWidth = Math.max(0.2, 1.5 * this.pixel);
    for (const object of predictions?.objects ?? []) {
      for (const { probability, points } of object.hypotheses ?? []) {
        context.globalAlpha = 0.15 + 0.6 * Math.min(1, Math.max(0, probability ?? 1));
        this.#line(points?.map((point) => point.x), points?.map((point) => point.y));
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  #way(points, color, width, dash) {
    if (!points?.length) return;
    const { context } = this;
    context.strokeStyle = color;
    context.lineWidth = Math.max(0.3, width * this.pixel);
    context.setLineDash(dash);
    this.#line(points.map((point) => point.x), points.map((point) => point.y));
    context.stroke();
    context.setLineDash([]);
  }

  // An upright box; the bar shows where its front is.
  #box({ x, y, heading, length, width }, color) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(heading);
    context.fillStyle = context.strokeStyle = color;
    context.globalAlpha = 0.35;
    context.fillRect(-length / 2, -width / 2, length, width);
    context.globalAlpha = 1;
    context.lineWidth = Math.max(0.12, 1.5 * this.pixel);
    context.strokeRect(-length / 2, -width / 2, length, width);
    context.fillRect(length / 2 - length / 8, -width / 2, length / 8, width);
    context.restore();
  }

  #outline({ x, y, heading, length, width }, color) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(heading);
    context.strokeStyle = color;
    context.lineWidth = this.pixel;
    context.strokeRect(-length / 2, -width / 2, length, width);
    context.restore();
  }

  #velocity({ x, y, heading, length, speed }) {
    if (!(Math.abs(speed) >= STANDS_MPS)) return;
    const { context, colors } = this;
    const from = (Math.sign(speed) * length) / 2;
    const to = from + speed * VELOCITY_S;
    const head = Math.sign(speed) * Math.max(0.6, 4 * this.pixel);
    context.save();
    context.translate(x, y);
    context.rotate(heading);
    context.strokeStyle = colors.velocity;
    context.lineWidth = Math.max(0.15, 1.5 * this.pixel);
    context.beginPath();
    context.moveTo(from, 0);
    context.lineTo(to, 0);
    context.moveTo(to - head, head / 2);
    context.lineTo(to, 0);
    context.lineTo(to - head, -head / 2);
    context.stroke();
    context.restore();
  }

  #isInSight([x, y]) {
    return x > -LABEL[0] && x < this.width + LABEL[0] && y > 0 && y < this.height + LABEL[1];
  }

  #labels() {
    if (this.camera.scale < 4) return;
    const { context, colors } = this;
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "center";
    context.fillStyle = colors.text;
    const written = [];
    for (const object of this.objects) {
      const [x, y] = this.toWindow(object.x, object.y);
      const above = (Math.hypot(object.length * Math.sin(object.heading - this.camera.angle),
                                object.width) / 2) * this.camera.scale;
      const place = [x, y - above - 5];
      // One that would lie on another could not be read, nor could the other.
      if (Math.abs(object.speed) >= STANDS_MPS && this.#isInSight(place)
          && !written.some(([wx, wy]) => Math.abs(wx - place[0]) < LABEL[0] && Math.abs(wy - place[1]) < LABEL[1])) {
        context.fillText(`${fixed(object.speed, 1)} m/s`, ...place);
        written.push(place);
      }
    }
  }

  #yardstick() {
    const { context, colors } = this;
    const wanted = 100 / this.camera.scale;
    const ten = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((factor) => factor * ten).find((metres) => metres <= wanted);
    const x = 12;
    const y = this.height - 14;
    context.strokeStyle = context.fillStyle = colors.soft;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - 4);
    context.lineTo(x, y);
    context.lineTo(x + length * this.camera.scale, y);
    context.lineTo(x + length * this.camera.scale, y - 4);
    context.stroke();
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(`${length} m`, x + 4, y - 6);
  }
}
