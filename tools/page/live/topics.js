// The list of topics; an open one shows its newest message.
import { element, make } from "../controls.js";
import { decode } from "./messages.js";
import { rate } from "./overview.js";
import { Rows, say } from "./rows.js";
import { MessageTree } from "./tree.js";

const PERIOD_MS = 200;  // A message is written out so often at most.

export class Topics {
  // `plot(topic, path)` is called when a field is to be drawn.
  constructor(connection, overview, types, plot) {
    this.connection = connection;
    this.overview = overview;
    this.types = types;
    this.plot = plot;
    this.open = new Map();  // By topic: what ends its subscription.
    this.isShown = false;
    this.rows = new Rows(element("topics"), (name) => this.#row(name));
    element("topic_filter").addEventListener("input", () => this.update());
  }

  // Topics that are open are subscribed to while they are seen.
  setShown(isShown) {
    this.isShown = isShown;
    this.open.forEach((one) => (isShown ? one.begin() : one.end()));
    this.update();
  }

  clear() {
    this.open.forEach((one) => one.end());
    this.open.clear();
    this.rows.show([], () => {});
  }

  update() {
    if (!this.isShown) {
      return;
    }
    const wanted = element("topic_filter").value.trim().toLowerCase();
    const names = [...this.connection.channels.keys()].filter((name) => name.toLowerCase().includes(wanted)
      && !this.overview.topics.get(name)?.is_service);
    this.rows.show(names, (row, name) => {
      const one = this.overview.topics.get(name);
      say(row.rate, one ? rate(one.hz) : "");
      say(row.drops, !one ? "" : one.subscribers?.length || one.dropped ? `${one.dropped} dropped` : `${one.published} messages`);
      row.drops.classList.toggle("bad", one?.dropsHz > 0);
    });
    say(element("topics_problem"), names.length === 0 ? "No topic has this in its name." : this.overview.problem);
  }

  #row(name) {
    const button = make("button", { type: "button", className: "topic_name", textContent: name, "aria-expanded": "false" });
    const row = make("li", {}, make("div", { className: "topic_line" }, button));
    row.kind = make("span", { className: "type", textContent: this.connection.channels.get(name).schemaName });
    row.rate = make("span", { className: "rate" });
    row.drops = make("span", { className: "drops" });
    row.firstChild.append(row.kind, row.rate, row.drops);
    button.addEventListener("click", () => {
      const isOpen = this.open.has(name);
      button.setAttribute("aria-expanded", !isOpen);
      if (isOpen) {
        this.open.get(name).end();
        this.open.delete(name);
        row.body.remove();
      } else {
        row.body = make("div", { className: "message", textContent: "no message yet" });
        row.append(row.body);
        this.open.set(name, this.#opened(name, row.body));
        this.open.get(name).begin();
      }
    });
    return row;
  }

  #opened(name, body) {
    let stop = null;
    let tree = null;
    let newest = null;
    let timer = null;
    let last = -Infinity;
    const write = () => {
      timer = null;
      last = performance.now();
      try {
        const type = this.types.of(this.connection.channels.get(name));
        if (!tree) {
          tree = new MessageTree(name, type, (path) => this.plot(name, path));
          body.replaceChildren(tree.element);
        }
        tree.update(decode(type, newest));
      } catch (error) {
        body.textContent = `The message cannot be read: ${error.message}`;
        tree = null;
      }
    };
    return {
      begin: () => {
        stop ??= this.connection.subscribe(name, (_, payload) => {
          newest = payload;
          timer ??= setTimeout(write, Math.max(0, last + PERIOD_MS - performance.now()));
        });
      },
      end: () => {
        stop?.();
        stop = null;
        clearTimeout(timer);
        timer = null;
      },
    };
  }
}
