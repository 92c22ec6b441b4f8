// A list of tabs, each with its panel, of which one is shown.
import { element } from "../controls.js";

export class Tabs {
  // `changed(name)` is called with the one that is shown from now on.
  constructor(changed) {
    this.changed = changed;
    this.tabs = [...element("tabs").querySelectorAll("[role=tab]")];
    this.tabs.forEach((tab) => {
      tab.addEventListener("click", () => this.show(this.nameOf(tab)));
      tab.addEventListener("keydown", (event) => {
        const there = this.tabs.filter((one) => one.offsetParent !== null);  // Some have no use for a recording.
        const at = there.indexOf(tab);
        const last = there.length - 1;
        const next = { ArrowRight: at === last ? 0 : at + 1, ArrowLeft: at === 0 ? last : at - 1, Home: 0, End: last }[event.key];
        if (next !== undefined) {
          event.preventDefault();
          this.show(this.nameOf(there[next]));
          there[next].focus();
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
