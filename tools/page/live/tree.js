// A message as a tree of its fields. Its elements stay where they are from message to message.
import { make } from "../controls.js";
import { enumName, kindOf, nameOfPath, numberOf, valueOf } from "./messages.js";
import { say } from "./rows.js";

const MOST_ELEMENTS = 32;  // Of a list.

function textOf(value, field) {
  if (value === undefined || value === null) {
    return "not set";
  }
  if (value instanceof Uint8Array) {
    return `${value.length} bytes`;
  }
  if (kindOf(field) === "enum") {
    return enumName(field, value);
  }
  if (typeof value === "number") {
    return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(7)));
  }
  return typeof value === "string" ? JSON.stringify(value) : String(value);
}

// A field, or an element of a list.
class Node {
  constructor(label, path, field, isElement, tree) {
    this.path = path;
    this.field = field;
    this.tree = tree;
    this.isList = field.fieldKind === "list" && !isElement;
    this.isMap = field.fieldKind === "map";
    this.isMessage = !this.isList && kindOf(field) === "message";
    this.value = make("span", { className: "value" });
    const canOpen = this.isList || this.isMessage || this.isMap;
    this.name = make(canOpen ? "button" : "span", { className: "name", textContent: label });
    this.line = make("div", { className: "field" }, this.name, this.value);
    this.element = make("li", {}, this.line);
    if (canOpen) {
      this.name.type = "button";
      this.name.setAttribute("aria-expanded", "false");
      this.name.addEventListener("click", () => this.#toggle());
    }
  }

  #toggle(opens = !this.list) {
    this.name.setAttribute("aria-expanded", opens);
    this.list?.remove();
    this.list = opens ? make("ul") : null;
    this.nodes = [];
    if (opens) {
      this.element.append(this.list);
      this.update(this.last);
    }
  }

  open() {
    this.#toggle(true);
  }

  update(value) {
    this.last = value;
    if (this.isList) {
      say(this.value, `${value?.length ?? 0} elements`);
      if (this.list) this.#updateElements(value ?? []);
    } else if (this.isMap) {
      const entries = Object.entries(value ?? {});
      say(this.value, `${entries.length} entries`);
      if (this.list) {
        this.list.replaceChildren(...entries.slice(0, MOST_ELEMENTS).map(([key, one]) =>
          make("li", { textContent: `${key}: ${typeof one === "object" ? "{…}" : one}` })));
      }
    } else if (this.isMessage) {
      say(this.value, value === undefined ? "not set" : this.list ? "" : "{…}");
      if (this.list) this.#updateFields(value);
    } else {
      say(this.value, textOf(value, this.field));
      if (!this.plot && numberOf(value) !== null && kindOf(this.field) !== "enum") {
        this.#offerPlot();
      }
    }
  }

  // By button, or dragged to a plot.
  #offerPlot() {
    const name = nameOfPath(this.path);
    this.plot = make("button", { type: "button", className: "plot_it", textContent: "plot", "aria-label": `plot ${name}` });
    this.plot.addEventListener("click", () => this.tree.plot(this.path));
    this.line.append(this.plot);
    this.line.draggable = true;
    this.line.addEventListener("dragstart", (event) => {
      event.dataTransfer.setData("application/x-fastcycle-field", JSON.stringify({ topic: this.tree.topic, path: this.path }));
      event.dataTransfer.setData("text/plain", `${this.tree.topic} ${name}`);
      event.dataTransfer.effectAllowed = "copy";
    });
  }

  #updateFields(message) {
    const { fields } = this.field.message;
    for (const [i, field] of fields.entries()) {
      this.nodes[i] ??= this.#add(new Node(field.name, [...this.path, field.name], field, false, this.tree));
      this.nodes[i].update(message === undefined ? undefined : valueOf(message, field));
    }
  }

  #updateElements(values) {
    const count = Math.min(values.length, MOST_ELEMENTS);
    while (this.nodes.length > count) {
      this.nodes.pop().element.remove();
    }
    for (let i = 0; i < count; ++i) {
      this.nodes[i] ??= this.#add(new Node(`[${i}]`, [...this.path, i], this.field, true, this.tree));
      this.nodes[i].update(values[i]);
    }
    this.more ??= this.list.appendChild(make("li", { className: "more" }));
    this.list.append(this.more);
    say(this.more, values.length > count ? `… ${values.length - count} more` : "");
  }

  #add(node) {
    this.list.append(node.element);
    return node;
  }
}

export class MessageTree {
  // `plot(path)` is called when a field is to be drawn.
  constructor(topic, type, plot) {
    this.topic = topic;
    this.plot = plot;
    this.root = new Node(type.typeName, [], { fieldKind: "message", message: type }, false, this);
    this.root.open();
    this.element = make("ul", { className: "tree" }, this.root.element);
  }

  update(message) {
    this.root.update(message);
  }
}
