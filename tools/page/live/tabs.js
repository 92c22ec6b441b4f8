// A list of tabs, each with its panel, of which one is shown.
import { element } from "../controls.js";

export class Tabs {
  // `changed(name)` is called with the one that is shown from now on.
  constructor(changed) {
    this.changed = changed;
    this.tabs = [...element("tabs").querySelectorAll("[role=tab]")];
    this.tabs.forEach((tab, i) => {
      tab.addEventListener("click", () => this.show(this.nameOf(tab)));
      tab.addEventListener("keydown", (event) => {
        const last = this.tabs.length - 1;
        const next = { ArrowRight: i === last ? 0 : i + 1, ArrowLeft: i === 0 ? last : i - 1, Home: 0, End: last }[event.key];
        if (next !== undefined) {
          event.preventDefault();
          this.show(this.nameOf(this.tabs[next]));
          this.tabs[next].focus();
        }
      });
    });
  }

  nameOf(tab) {
    return tab.id.replace("tab_", "");
  }

  show(name) {
    this.shown = name;
    for (const tab of this.tabs) {
      const isShown = this.nameOf(tab) === name;
      tab.setAttribute("aria-selected", isShown);
      tab.tabIndex = isShown ? 0 : -1;
      element(`panel_${this.nameOf(tab)}`).hidden = !isShown;
    }
    this.changed(name);
  }
}
