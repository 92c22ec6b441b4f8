// Picks out of messages what a view names, as `fastcycle render` does with those of a log (docs/reference/page.md).
import { enumName, fieldOf, kindOf, valueOf } from "./messages.js";

const MOST_POINTS = 10_000;  // Of a sweep.
const FARTHEST_M = 327;  // In 16 bits of centimetres.

// Says how to get the picked fields of messages of `type`: a function from a message, and a function from a time in
// nanoseconds to the page's time, to an object. Throws an Error that says what the type does not have.
export function bindFields(fields, type) {
  const bound = Object.entries(fields).map(([name, pick]) => [name, bindPick(typeof pick === "string" ? { from: pick } : pick, type)]);
  return (message, toTime) => {
    const object = {};
    for (const [name, get] of bound) {
      object[name] = get(message, toTime);
    }
    return object;
  };
}

function bindPick(pick, type) {
  const way = [];
  let within = type;
  for (const name of pick.from.split(".")) {
    const isInOne = within && way.at(-1)?.fieldKind !== "list";
    const field = isInOne ? fieldOf(within, name) : undefined;
    if (!field) {
      throw new Error(`${type.typeName} has no field ${pick.from}`);
    }
    way.push(field);
    within = kindOf(field) === "message" ? field.message : null;
  }
  const field = way.at(-1);
  if (Boolean(within) !== Boolean(pick.fields)) {
    throw new Error(`${pick.from} of ${type.typeName} is no ${pick.fields ? "message" : "single value"}`);
  }
  const one = bindValue(pick, field);
  const every = pick.every ?? 1;
  return (message, toTime) => {
    let value = message;
    for (const step of way) {
      value = valueOf(value, step);
      if (value === undefined) {
        return null;
      }
    }
    if (field.fieldKind !== "list") {
      return one(value, toTime);
    }
    const values = [];
    for (let i = 0; i < value.length; i += every) {
      values.push(one(value[i], toTime));
    }
    return values;
  };
}

function bindValue(pick, field) {
  if (pick.fields) {
    const get = bindFields(pick.fields, field.message);
    return get;
  }
  if (pick.points) {
    return (bytes) => packPoints(bytes, pick.points);
  }
  if (pick.time) {
    return (value, toTime) => toTime(value);
  }
  if (kindOf(field) === "enum") {
    return (value) => enumName(field, value);
  }
  return (value) => (typeof value === "bigint" || typeof value === "boolean" ? Number(value)
    : typeof value === "number" && !Number.isFinite(value) ? null : value);
}

// Of each point x, y and z in centimetres and the part of the turn that was over, 16 bits each.
function packPoints(bytes, { stride, x, y, z, time }) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const there = [];
  for (let at = 0; at + stride <= bytes.length; at += stride) {
    const place = [x, y, z].map((offset) => view.getFloat32(at + offset, true));
    // At the origin there is no echo.
    if (place.every((value) => Math.abs(value) < FARTHEST_M) && place.some((value) => value !== 0)) {
      there.push([...place, time === undefined ? 0 : view.getUint16(at + time, true)]);
    }
  }
  const step = Math.max(1, Math.ceil(there.length / MOST_POINTS));
  const packed = new DataView(new ArrayBuffer(8 * Math.ceil(there.length / step)));
  for (let i = 0, at = 0; i < there.length; i += step, at += 8) {
    for (let j = 0; j < 3; ++j) {
      packed.setInt16(at + 2 * j, Math.round(100 * there[i][j]), true);
    }
    packed.setUint16(at + 6, there[i][3], true);
  }
  return new Uint8Array(packed.buffer);
}
