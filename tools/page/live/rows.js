// Rows of a table that are filled again and again: each stays the same element, so that what has the focus keeps it.
import { make } from "../controls.js";

export class Rows {
  #rows = new Map();

  // `build(key)` gives a new row: an element with its `cells`.
  constructor(place, build) {
    this.place = place;
    this.build = build;
  }

  // One row for each key, in this order; `fill(row, key)` is called with each.
  show(keys, fill) {
    const wanted = new Set(keys);
    for (const [key, row] of this.#rows) {
      if (!wanted.has(key)) {
        row.remove();
        this.#rows.delete(key);
      }
    }
    let place = this.place.firstElementChild;
    for (const key of keys) {
      let row = this.#rows.get(key);
      if (!row) {
        row = this.build(key);
        this.#rows.set(key, row);
      }
      if (row === place) {
        place = place.nextElementSibling;
      } else {
        this.place.insertBefore(row, place);
      }
      fill(row, key);
    }
  }

  get(key) {
    return this.#rows.get(key);
  }
}

export function say(place, text) {
  if (place.textContent !== text) {
    place.textContent = text;
  }
}

// A table with these heads, and its body.
export function tableOf(heads) {
  const body = make("tbody");
  const head = make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { textContent: text, scope: "col" }))));
  return [make("table", {}, head, body), body];
}
