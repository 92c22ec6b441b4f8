// What a log had, or a run says: layers, each with its messages in the order of their times.

function decodeBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

// Values, one after the other, get their names.
function named(names, values, offset) {
  const result = {};
  names.forEach((name, i) => {
    const value = values[offset + i];
    if (typeof name === "string") {
      result[name] = value;
      return;
    }
    const [own, fields] = name;
    result[own] = value === null || value === undefined ? null
      : Array.isArray(value[0]) || value.length === 0 ? value.map((one) => named(fields, one, 0))
      : named(fields, value, 0);
  });
  return result;
}

// Messages in the order of their times: when each was published, and when its content was measured.
class Timeline {
  constructor(topic, published, taken) {
    this.topic = topic;
    this.published = published;
    this.taken = taken;
  }
  get count() {
    return this.published.length;
  }
  // The last one that is not after `time`; none before the first.
  lastPublished(time) {
    const index = lastNotAfter(this.published, time);
    return index < 0 ? null : this.get(index);
  }
  // The two that `time` lies between, and how far it is from the first to the second.
  around(time) {
    if (this.count === 0) {
      return null;
    }
    const index = Math.max(0, lastNotAfter(this.taken, time));
    const next = Math.min(index + 1, this.count - 1);
    const span = this.taken[next] - this.taken[index];
    const part = span > 0 ? Math.min(1, Math.max(0, (time - this.taken[index]) / span)) : 0;
    return { a: this.get(index), b: this.get(next), part, age: time - this.taken[index] };
  }
}

// Of a log: messages become objects when they are looked at for the first time.
class Layer extends Timeline {
  constructor({ topic, names, messages }) {
    const at = names.indexOf("time");
    const published = messages.map((message) => message[0]);
    super(topic, published, at < 0 ? published : messages.map((message) => message[at + 1] ?? message[0]));
    this.names = names;
    this.values = messages;
    this.objects = new Array(messages.length);
  }
  get(index) {
    return (this.objects[index] ??= { published: this.published[index], ...named(this.names, this.values[index], 1) });
  }
  column(name) {
    const at = this.names.findIndex((one) => one === name || one[0] === name);
    return at < 0 ? null : this.values.map((message) => message[at + 1]);
  }
}

// Of a run: it grows at its end, and forgets at its beginning. The last message stays, however old it is.
export class GrowingLayer extends Timeline {
  constructor(topic) {
    super(topic, [], []);
    this.objects = [];
  }
  // `object` is one, or a function that makes it.
  add(published, taken, object) {
    // Mostly at the end; but latched messages come again after a gap in the connection.
    const before = lastNotAfter(this.published, published);
    const isThere = before >= 0 && this.published[before] === published;
    const at = isThere ? before : before + 1;
    // In order, for who searches.
    const ordered = Math.max(taken, this.taken[at - 1] ?? taken);
    [[this.published, published], [this.taken, ordered], [this.objects, object]].forEach(([list, value]) =>
      list.splice(at, isThere ? 1 : 0, value));
  }
  get(index) {
    const object = this.objects[index];
    if (typeof object !== "function") {
      return object;
    }
    return (this.objects[index] = { published: this.published[index], ...object() });
  }
  // What was published before `time`. Many at once: each is a move of all that stays.
  forget(time) {
    const gone = Math.min(lastNotAfter(this.published, time), this.count - 1);
    if (gone > 32 && gone > this.count / 8) {
      for (const list of [this.published, this.taken, this.objects]) {
        list.splice(0, gone);
      }
    }
  }
  clear() {
    this.published.length = this.taken.length = this.objects.length = 0;
  }
}

export function lastNotAfter(times, time) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low - 1;
}

// Of what is no number on one side, the other; null where there is none.
export function mix(a, b, part) {
  return Number.isFinite(a) && Number.isFinite(b) ? a + (b - a) * part : a ?? b ?? null;
}

export function mixAngle(a, b, part) {
  return Number.isFinite(a) && Number.isFinite(b) ? a + Math.atan2(Math.sin(b - a), Math.cos(b - a)) * part : a ?? b ?? 0;
}

const hasPlace = (one) => Number.isFinite(one?.x) && Number.isFinite(one?.y);

// A number with so many digits, without the sign of what is rounded to 0; empty if it is none.
export function fixed(value, digits) {
  return Number.isFinite(value) ? value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1") : "";
}

// A name as ENGAGED_DEGRADED in words.
export function inWords(name) {
  return String(name ?? "").toLowerCase().replaceAll("_", " ");
}

export class Drive {
  constructor(json) {
    this.duration = json.duration;
    this.constants = json.constants;
    this.layers = {};
    // Of a comparison: the new drive, and by topic and field how its messages differ.
    this.other = json.other ? new Drive(json.other) : null;
    this.differences = json.differences ?? [];
    if (this.other) {
      this.duration = Math.max(this.duration, this.other.duration);
    }
    for (const [name, layer] of Object.entries(json.layers)) {
      this.layers[name] = new Layer(layer);
    }
  }

  // All of a layer, in their order.
  messagesOf(name) {
    const layer = this.layers[name];
    return layer ? layer.published.map((_, i) => layer.get(i)) : [];
  }

  // Where the vehicle was; the first and the last place hold before and after. null where no place is known.
  egoAt(time) {
    const found = this.layers.ego?.around(time);
    if (!found || !hasPlace(found.a) || !hasPlace(found.b)) {
      return null;
    }
    const { a, b, part } = found;
    return {
      x: mix(a.x, b.x, part),
      y: mix(a.y, b.y, part),
      heading: mixAngle(a.heading, b.heading, part),
      speed: mix(a.speed, b.speed, part),
      acceleration: mix(a.acceleration, b.acceleration, part),
      quality: a.quality,
      length: this.constants.ego_length ?? 4.5,
      width: this.constants.ego_width ?? 1.8,
    };
  }

  // Where the road ends, in the map: the last that was published, from where the vehicle was then.
  bordersAt(time) {
    const borders = this.layers.borders?.lastPublished(time);
    const ego = borders && this.egoAt(borders.time ?? borders.published);
    if (!ego) {
      return [];
    }
    const [ahead, aside] = [Math.cos(ego.heading), Math.sin(ego.heading)];
    return ["left", "right"].flatMap((side) =>
      (borders[`${side}_x`] ?? []).map((x, i) => {
        const y = borders[`${side}_y`]?.[i];
        return hasPlace({ x, y }) && [ego.x + x * ahead - y * aside, ego.y + x * aside + y * ahead];
      }).filter(Boolean));
  }

  // The tracked boxes, between two messages on their way from one to the other.
  objectsAt(time) {
    const found = this.layers.objects?.around(time);
    if (!found || time < this.layers.objects.taken[0]) {
      return [];
    }
    const { a, b, part, age } = found;
    const next = new Map((b.objects ?? []).map((object) => [object.id, object]));
    return (a.objects ?? []).filter(hasPlace).map((object) => {
      const later = next.get(object.id);
      if (later && b !== a && hasPlace(later)) {
        return {
          ...object,
          x: mix(object.x, later.x, part),
          y: mix(object.y, later.y, part),
          heading: mixAngle(object.heading, later.heading, part),
          speed: mix(object.speed, later.speed, part),
        };
      }
      const on = (object.speed ?? 0) * Math.min(age, 0.2);  // It is not there any more soon.
      const heading = object.heading ?? 0;
      return { ...object, heading, x: object.x + on * Math.cos(heading), y: object.y + on * Math.sin(heading) };
    });
  }

  // The points of the last sweep, in the map: x, y and height above the ground, one after the other.
  pointsAt(time) {
    const layer = this.layers.points;
    const index = layer ? lastNotAfter(layer.taken, time) : -1;
    if (index < 0 || time - layer.taken[index] > 0.5) {
      return null;
    }
    const sweep = layer.get(index);
    if (this.sweep?.of !== sweep) {
      this.sweep = { of: sweep, points: this.#placed(sweep) };
    }
    return this.sweep.points;
  }

  #placed(sweep) {
    const bytes = typeof sweep.points === "string" ? decodeBase64(sweep.points) : sweep.points ?? new Uint8Array();
    const view = new DataView(bytes.buffer, bytes.byteOffset);
    const size = 8;
    const count = Math.floor(bytes.length / size);
    const placed = new Float32Array(3 * count);
    const duration = (sweep.duration_ns ?? 0) / 1e9;
    const time = sweep.time ?? sweep.published;
    const from = this.egoAt(time) ?? { x: 0, y: 0, heading: 0 };  // As if it stood there, where that is not known.
    const to = this.egoAt(time + duration) ?? from;
    for (let i = 0; i < count; ++i) {
      const part = view.getUint16(i * size + 6, true) / 65536;
      const heading = mixAngle(from.heading, to.heading, part);
      const forward = view.getInt16(i * size, true) / 100 + (sweep.forward ?? 0);
      const left = view.getInt16(i * size + 2, true) / 100;
      placed[3 * i] = mix(from.x, to.x, part) + forward * Math.cos(heading) - left * Math.sin(heading);
      placed[3 * i + 1] = mix(from.y, to.y, part) + forward * Math.sin(heading) + left * Math.cos(heading);
      placed[3 * i + 2] = view.getInt16(i * size + 4, true) / 100 + (sweep.height ?? 0);
    }
    return placed;
  }

  // When the state became another one.
  stateChanges() {
    const layer = this.layers.state;
    const changes = [];
    for (let i = 0; layer && i < layer.count; ++i) {
      const { published, state, reason } = layer.get(i);
      if (changes.length === 0 || changes.at(-1).state !== state) {
        changes.push({ time: Math.max(0, published), state, reason });
      }
    }
    return changes;
  }

  // good, careful, bad or idle: what a state means.
  meaningOf(state) {
    const is = (names) => (names ?? []).includes(state);
    return is(this.constants.driving) ? "good" : is(this.constants.careful) ? "careful"
      : is(this.constants.stopping) ? "bad" : "idle";
  }
}

function corners({ x, y, heading, length, width }) {
  const c = Math.cos(heading);
  const s = Math.sin(heading);
  return [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([f, l]) => [
    x + (f * length * c - l * width * s) / 2,
    y + (f * length * s + l * width * c) / 2,
  ]);
}

function toSegment([px, py], [ax, ay], [bx, by]) {
  const dx = bx - ax;
  const dy = by - ay;
  const along = Math.min(1, Math.max(0, ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(px - ax - along * dx, py - ay - along * dy);
}

function isInside([px, py], { x, y, heading, length, width }) {
  const c = Math.cos(heading);
  const s = Math.sin(heading);
  return Math.abs((px - x) * c + (py - y) * s) <= length / 2 && Math.abs((py - y) * c - (px - x) * s) <= width / 2;
}

// Between two boxes; 0 where a corner of one is in the other.
export function distance(a, b) {
  const as = corners(a);
  const bs = corners(b);
  if (as.some((corner) => isInside(corner, b)) || bs.some((corner) => isInside(corner, a))) {
    return 0;
  }
  let least = Infinity;
  for (let i = 0; i < 4; ++i) {
    for (let j = 0; j < 4; ++j) {
      least = Math.min(least, toSegment(as[i], bs[j], bs[(j + 1) % 4]), toSegment(bs[j], as[i], as[(i + 1) % 4]));
    }
  }
  return least;
}
