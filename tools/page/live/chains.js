// Latency chains: how old what comes out is, and where on the way the time goes.
import { element, make } from "../controls.js";
import { say } from "./rows.js";

const PERIOD_MS = 2000;

const digits = (us) => (us / 1000).toFixed(us < 100_000 ? 1 : 0);
const ms = (us) => (us === null || us === undefined ? "–" : `${digits(us)} ms`);

const both = (summary) => (summary ? `${digits(summary.p50)} / ${digits(summary.p99)}` : "–");

export class ChainList {
  constructor(connection, overview) {
    this.connection = connection;
    this.overview = overview;
  }

  show() {
    this.update();
    this.timer ??= setInterval(() => this.update(), PERIOD_MS);
  }

  hide() {
    clearInterval(this.timer);
    this.timer = undefined;
  }

  async update() {
    if (this.overview.isThere && !this.overview.documents.includes("chains")) {
      this.#say("The application has no latency chains (\"chains\" in its file).");
      return;
    }
    try {
      const { json } = await this.connection.ask({ document: { name: "chains" } }, "document");
      const chains = JSON.parse(json);
      this.chains = Array.isArray(chains) ? chains : chains.chains ?? [];
      element("chains").replaceChildren(...this.chains.map((chain) => this.#chain(chain)));
      say(element("chains_problem"), this.chains.length === 0 ? "The application has no latency chains." : "");
    } catch (error) {
      this.#say(error.message);
    }
  }

  #say(text) {
    say(element("chains_problem"), text);
    element("chains").replaceChildren();
  }

  #chain({ name, from, to, deadline_ms, count, breaches, dropped, age_us, hops, largest_contributor: largest, judged }) {
    const times = hops.map((hop) => [hop.waiting_us?.p50 ?? 0, hop.running_us?.p50 ?? 0]);
    const sums = times.map(([waiting, running]) => waiting + running);
    const whole = sums.reduce((sum, one) => sum + one, 0) || 1;
    const most = sums.indexOf(Math.max(...sums));
    const rows = hops.map((hop, i) => {
      const [waiting, running] = times[i];
      const part = (className, us) => {
        const bar = make("i", { className });
        bar.style.width = `${(100 * us) / whole}%`;
        return bar;
      };
      const isMost = i === most && sums[i] > 0;
      return make("tr", { className: isMost ? "most" : "" },
        make("th", { scope: "row", textContent: hop.component }, ...isMost ? [make("small", { textContent: " takes the most" })] : []),
        make("td", { textContent: hop.topic ?? "" }),
        make("td", { textContent: both(hop.waiting_us) }), make("td", { textContent: both(hop.running_us) }),
        make("td", { className: "bars", "aria-hidden": "true" }, part("waiting", waiting), part("running", running)),
        make("td", { textContent: String(hop.breaches) }));
    });
    const heads = ["component", "publishes", "waits, ms", "runs, ms", "share", "late"];
    return make("section", { className: "chain" },
      make("h3", { textContent: name }),
      make("p", { textContent: `${from} → ${to}: at most ${deadline_ms} ms. ${judged === false ? "Not judged in this replay. " : ""}`
        + `Age: p50 ${ms(age_us?.p50)}, p99 ${ms(age_us?.p99)}, largest ${ms(age_us?.max)} of ${count}; `
        + `${breaches} too late, ${dropped} of them dropped. Below: p50 / p99, the share of the p50s, and how often it was the reason.` }),
      ...largest ? [make("p", { className: "bad", textContent:
        `${largest.breaches} breaches by the ${largest.part} of ${largest.component}.` })] : [],
      make("table", { className: "numbers" },
        make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { textContent: text, scope: "col" })))),
        make("tbody", {}, ...rows)));
  }
}
