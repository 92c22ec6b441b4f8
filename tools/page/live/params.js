// The parameters of the components as controls.
import { element, make } from "../controls.js";
import { Rows, say } from "./rows.js";

const PERIOD_MS = 2000;

const isNumber = ({ type }) => type === "number" || type === "integer";

export class Params {
  constructor(connection, overview) {
    this.connection = connection;
    this.overview = overview;
    this.params = [];
    this.components = new Rows(element("params"), (component) => {
      const section = make("fieldset", {}, make("legend", { textContent: component }));
      const place = make("div");
      section.append(place);
      section.rows = new Rows(place, (name) => this.#row(`${component}.${name}`));
      return section;
    });
    element("param_filter").addEventListener("input", () => this.#show());
  }

  show() {
    this.update();
    this.timer ??= setInterval(() => this.update(), PERIOD_MS);
  }

  hide() {
    clearInterval(this.timer);
    this.timer = undefined;
  }

  clear() {
    this.params = [];
    this.components.show([], () => {});
  }

  async update() {
    try {
      this.params = (await this.connection.ask({ params: {} }, "params")).params ?? [];
      say(element("params_problem"), this.params.length === 0 ? "The components have no parameters." : "");
    } catch (error) {
      say(element("params_problem"), error.message);
    }
    this.#show();
  }

  #show() {
    const why = this.overview.isThere ? this.overview.whyNot("params") : "";
    say(element("params_allowed"), this.overview.isThere ? why : "");
    const wanted = element("param_filter").value.trim().toLowerCase();
    const byComponent = new Map();
    for (const param of this.params) {
      if (`${param.component}.${param.name}`.toLowerCase().includes(wanted)) {
        byComponent.set(param.component, [...byComponent.get(param.component) ?? [], param]);
      }
    }
    this.components.show([...byComponent.keys()], (section, component) => {
      const params = new Map(byComponent.get(component).map((param) => [param.name, param]));
      section.rows.show([...params.keys()], (row, name) => this.#fill(row, params.get(name), why));
    });
  }

  #row(id) {
    const row = make("div", { className: "param" });
    row.key = `param_${id}`;
    return row;
  }

  #fill(row, param, why) {
    if (!row.control) {
      this.#build(row, param);
    }
    const reason = why || (param.is_tunable ? "" : "Only in the file of the application: it is read at the start.");
    row.control.disabled = reason !== "" || !this.overview.isThere;
    row.control.title = reason;
    const origin = param.origin === "changed" ? "changed" : "";
    say(row.origin, origin);
    // What somebody writes is left alone.
    if (row.control !== document.activeElement && !row.isWrong && row.shown !== param.value_json) {
      row.shown = param.value_json;
      row.write(param.value_json);
    }
  }

  #build(row, param) {
    const { name, type, unit, min_json, max_json, description, names = [] } = param;
    const input = (properties) => make("input", { id: row.key, ...properties });
    let control;
    if (type === "bool") {
      control = input({ type: "checkbox" });
      row.write = (json) => (control.checked = JSON.parse(json));
      row.read = () => JSON.stringify(control.checked);
    } else if (type === "enum") {
      control = make("select", { id: row.key }, ...names.map((one) => make("option", { value: one, textContent: one })));
      row.write = (json) => (control.value = JSON.parse(json));
      row.read = () => JSON.stringify(control.value);
    } else if (isNumber(param)) {
      control = input({ type: "number", step: type === "integer" ? "1" : "any", min: min_json, max: max_json });
      row.write = (json) => (control.value = json);
      row.read = () => control.value;
    } else if (type === "string" || type === "path") {
      control = input({ type: "text", spellcheck: false });
      row.write = (json) => (control.value = JSON.parse(json));
      row.read = () => JSON.stringify(control.value);
    } else {  // JSON, as it stands in the application's file.
      control = input({ type: "text", spellcheck: false });
      row.write = (json) => (control.value = json);
      row.read = () => control.value;
    }
    row.control = control;
    const range = min_json || max_json ? `${min_json || "…"} to ${max_json || "…"}` : "";
    row.origin = make("span", { className: "origin" });
    row.error = make("p", { className: "error", id: `${row.key}_error`, role: "status" });
    control.setAttribute("aria-describedby", row.error.id);
    control.addEventListener("change", () => this.#change(row, `${param.component}.${name}`));
    row.append(make("label", { htmlFor: row.key, textContent: name, title: description }), control,
               make("span", { className: "unit", textContent: [unit, range].filter(Boolean).join(", ") }), row.origin, row.error);
  }

  async #change(row, param) {
    const value_json = row.read();
    let wrong = "";
    try {
      if (value_json === "") {
        throw new Error("A value is missing.");
      }
      const { errors = [] } = await this.connection.ask({ change_params: { changes: [{ param, value_json }] } }, "params_changed");
      wrong = errors.join("\n");
    } catch (error) {
      wrong = error.message;
    }
    row.isWrong = wrong !== "";
    row.control.setAttribute("aria-invalid", row.isWrong);
    say(row.error, wrong);
    if (!row.isWrong) {
      row.shown = value_json;
    }
    this.update();
  }
}
