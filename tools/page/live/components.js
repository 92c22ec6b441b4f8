// The list of components with what can be done with each, and the modes.
import { element, make } from "../controls.js";
import { meaningOf, quantile, rate } from "./overview.js";
import { Rows, say, tableOf } from "./rows.js";

const LOOK_MS = 50;  // So often it is looked whether a mode was switched,
const MOST_LOOKS = 40;  // and so many times at most.
const ACTIONS = [["start", "ACTION_START"], ["stop", "ACTION_STOP"], ["restart", "ACTION_RESTART"]];

// Buttons that start, stop and restart a component. `update()` disables what is not allowed or makes no sense.
export function lifecycleButtons(component, connection, overview) {
  const answer = make("output", { className: "answer" });
  const buttons = ACTIONS.map(([word, action]) => {
    const button = make("button", { textContent: word, type: "button", "aria-label": `${word} ${component}` });
    button.addEventListener("click", async () => {
      say(answer, "…");
      try {
        const done = await connection.ask({ lifecycle: { action, component } }, "done");
        say(answer, done.text);
      } catch (error) {
        say(answer, error.message);
      }
      overview.poll();
    });
    return button;
  });
  const box = make("span", { className: "lifecycle" }, ...buttons, answer);
  box.update = () => {
    const why = overview.isThere ? overview.whyNot("lifecycle") : "The run does not say what is allowed.";
    for (const button of buttons) {
      button.disabled = why !== "";
      button.title = why;
    }
  };
  box.update();
  return box;
}

export class Components {
  constructor(connection, overview) {
    this.connection = connection;
    this.overview = overview;
    const [table, body] = tableOf(["component", "state", "health", "CPU", "activations", "p99", "faults", ""]);
    table.className = "numbers";
    element("components").append(table);
    this.rows = new Rows(body, (name) => {
      const cells = Array.from({ length: 8 }, () => make("td"));
      const row = make("tr", {}, ...cells);
      row.parts = cells;
      row.buttons = lifecycleButtons(name, connection, overview);
      cells[7].append(row.buttons);
      return row;
    });
    element("switch_mode").addEventListener("click", () => this.#switch());
  }

  update() {
    const { overview } = this;
    say(element("components_problem"), overview.problem);
    this.rows.show([...overview.components.keys()], (row, name) => {
      const one = overview.components.get(name);
      const words = [name, one.state, one.health, Number.isFinite(one.cpu) ? `${(100 * one.cpu).toFixed(1)} %` : "–",
                     rate(one.hz), quantile(one.callback, "p99_ns"), String(one.faults)];
      words.forEach((word, i) => say(row.parts[i], word));
      row.parts[2].className = meaningOf(one);
      row.parts[2].title = one.health_reason || one.last_fault;
      row.buttons.update();
    });
    this.#updateModes();
  }

  #updateModes() {
    const { mode, modes } = this.overview;
    element("modes").hidden = modes.length === 0;
    say(element("no_modes"), this.overview.isThere && modes.length === 0 ? "The application has no modes." : "");
    const select = element("mode");
    if ([...select.options].map(({ value }) => value).join() !== modes.join()) {
      select.replaceChildren(...modes.map((name) => make("option", { value: name, textContent: name })));
      select.value = mode;
    }
    say(element("mode_now"), mode ? `now: ${mode}` : "");
    const why = this.overview.whyNot("lifecycle");
    for (const control of [select, element("switch_mode")]) {
      control.disabled = why !== "";
      control.title = why;
    }
  }

  async #switch() {
    const mode = element("mode").value;
    try {
      const request = { switch_mode: { mode, why: "asked for on the live page" } };
      const done = await this.connection.ask(request, "done");
      say(element("mode_answer"), done.text);
    } catch (error) {
      say(element("mode_answer"), error.message);
      return;
    }
    // It is switched a moment after the answer.
    for (let i = 0; i < MOST_LOOKS && this.overview.mode !== mode; i++) {
      await new Promise((ready) => setTimeout(ready, LOOK_MS));
      await this.overview.poll();
    }
  }
}
