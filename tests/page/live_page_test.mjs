// live_page_test.mjs FASTCYCLE ADS.json NODE_MODULES [PICTURES]: runs the ADS with --live and looks at its page in a
// browser: at what it says, at its pixels and at its own state; and asks the run whether it did what the page wanted.
// With PICTURES, a folder, it leaves pictures there. Ends with 77 and says why where there is no browser to look with.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const [fastcycle, application, nodeModules, pictures] = process.argv.slice(2).map((path) => resolve(path));
const BOUND_MS = 60_000;  // Of each wait: for a machine that does much else.

function skip(reason) {
  console.log(`live page: skipped: ${reason}`);
  process.exit(77);
}

if (!existsSync(join(nodeModules, "playwright-core"))) {
  skip("there is no playwright-core (./dev setup)");
}
const browserPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
if (!browserPath) {
  skip("there is no chromium (./dev setup)");
}
const { chromium } = createRequire(join(nodeModules, "x.js"))("playwright-core");

// ---- The run ----

const folder = mkdtempSync(join(tmpdir(), "fastcycle_live_page_"));
const runs = new Set();
process.on("exit", () => {
  runs.forEach((run) => run.kill("SIGKILL"));
  rmSync(folder, { recursive: true, force: true });
});
mkdirSync(join(folder, "sockets"), { mode: 0o700 });
// The ADS, its log as a topic, and two components of tests/live: its own have no parameter that can be changed while
// they run.
writeFileSync(join(folder, "more.json"), JSON.stringify({
  components: [
    { name: "logging", params: { topics: ["supervision/state", "fastcycle/log"] } },
    { name: "sensor", library: "live_parts", class: "Sensor", serve_period_ms: 50 },
    { name: "filter", library: "live_parts", class: "Filter" },
  ] }));

// The address of a new run, when it is there. Slow, so that the drive takes as long as the tests.
const start = (...words) =>
  launch("run", application, "--overlay", "more.json", "--rate", "0.1", "--live", "127.0.0.1:0", ...words);

function launch(...words) {
  const run = spawn(fastcycle, words,
                    { cwd: folder, env: { ...process.env, XDG_RUNTIME_DIR: join(folder, "sockets") }, stdio: ["ignore", "pipe", "pipe"] });
  runs.add(run);
  return new Promise((done, fail) => {
    let text = "";
    const late = setTimeout(() => fail(new Error(`no address after ${BOUND_MS} ms:\n${text}`)), BOUND_MS);
    const read = (bytes) => {
      text += bytes;
      const found = /(http:\/\/\S+)/.exec(text);
      if (found) {
        clearTimeout(late);
        done({ run, address: found[1] });
      }
    };
    run.stdout.on("data", read);
    run.stderr.on("data", read);
    run.on("exit", (code) => {
      runs.delete(run);
      fail(new Error(`the run ended with ${code}:\n${text}`));
    });
  });
}

async function end({ run }) {
  const ended = new Promise((done) => run.once("exit", done));
  run.kill("SIGINT");
  const late = setTimeout(() => run.kill("SIGKILL"), BOUND_MS);
  await ended;
  clearTimeout(late);
}

const first = await start("--inspect-allow", "params,lifecycle");
const { origin, searchParams } = new URL(first.address);

async function ask(request) {
  const response = await fetch(`${origin}/ask`, {
    method: "POST", body: JSON.stringify(request),
    headers: { Authorization: `Bearer ${searchParams.get("token")}`, "Content-Type": "application/json" } });
  assert.equal(response.status, 200);
  return response.json();
}

// ---- The page ----

const tests = [];
const test = (name, body) => tests.push([name, body]);
const state = (page) => page.evaluate(() => window.fastcycle.state());
const tabs = ["graph", "components", "chains", "topics", "params", "log"];
const show = (page, tab) => page.click(`#tab_${tab}`);

// Waits until the element's text matches: what a page shows comes a while after what was done.
const says = (page, selector, pattern) => page.waitForFunction(
  ([at, source, flags]) => new RegExp(source, flags).test(document.querySelector(at).textContent),
  [selector, pattern.source, pattern.flags]);

const paint = (page) => page.evaluate(() => new Promise((ready) => requestAnimationFrame(() => requestAnimationFrame(ready))));

// How many pixels of the scene have about the color of this name.
const pixels = (page, name) => page.evaluate((color) => {
  const { canvas, context, color: of } = window.fastcycle.scene;
  const [r, g, b] = of(color).match(/[0-9a-f]{2}/gi).map((digits) => parseInt(digits, 16));
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    count += Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 24;
  }
  return count;
}, name);

const shows = async (page, name, least) => {
  const until = Date.now() + BOUND_MS;
  let count = await pixels(page, name);
  while (count < least && Date.now() < until) {
    await paint(page);
    count = await pixels(page, name);
  }
  assert.ok(count >= least, `${name}: ${count} pixels, expected ${least}`);
};

// Texts that have less contrast than 4.5 with what is behind them.
const paleTexts = (page) => page.evaluate(() => {
  const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (color) => {
    pen.clearRect(0, 0, 1, 1);
    pen.fillStyle = color;
    pen.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = pen.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], [br, bg, bb]) => [r * a + br * (1 - a), g * a + bg * (1 - a), b * a + bb * (1 - a), 1];
  const behind = (element) => {
    const layers = [];
    for (let one = element; one; one = one.parentElement) {
      layers.push(rgba(getComputedStyle(one).backgroundColor));
      if (layers.at(-1)[3] === 1) break;
    }
    return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255, 1]);
  };
  const light = (color) => color.slice(0, 3).map((value) => value / 255)
    .map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4))
    .reduce((sum, value, i) => sum + value * [0.2126, 0.7152, 0.0722][i], 0);
  const pale = [];
  let looked = 0;
  for (const element of document.querySelectorAll("body *")) {
    const hasText = [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim() !== "")
      || element.matches("input:not([type=checkbox], [type=range]), select");
    const { width, height } = element.getBoundingClientRect();
    if (!hasText || element.matches("script, style, option") || width === 0 || height === 0
        || getComputedStyle(element).visibility === "hidden") {
      continue;
    }
    ++looked;
    const style = getComputedStyle(element);
    const frame = element instanceof SVGElement && element.parentElement.querySelector(".frame");
    const ground = frame ? rgba(getComputedStyle(frame).fill) : behind(element);
    const [a, b] = [light(over(rgba(frame ? style.fill : style.color), ground)), light(ground)];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) {
      pale.push(`${element.tagName}#${element.id}.${element.getAttribute("class") ?? ""} "${element.textContent.trim().slice(0, 30)}": ${contrast.toFixed(2)}`);
    }
  }
  return looked < 30 ? [`only ${looked} texts`] : pale;
});

test("the vehicle drives, and what is around it is drawn", async (page) => {
  for (const [color, least] of [["--road", 3000], ["--edge", 100], ["--ego", 30], ["--object", 50], ["--plan", 20]]) {
    await shows(page, color, least);
  }
  const place = () => page.evaluate(() => window.fastcycle.live.drive.egoAt(window.fastcycle.state().time));
  const before = await place();
  await page.waitForFunction(({ x, y }) => {
    const now = window.fastcycle.live.drive.egoAt(window.fastcycle.state().time);
    return Math.hypot(now.x - x, now.y - y) > 2;
  }, before);
  await page.waitForFunction(() => window.fastcycle.state().objects > 3);
  await says(page, "#readout", /m\/s/);
  await says(page, "#state", /./);
  const { firstPicture } = await state(page);
  console.log(`        first picture after ${firstPicture.toFixed(0)} ms`);
});

test("it asks only for what is shown", async (page) => {
  await show(page, "graph");
  assert.ok(!(await state(page)).subscribed.includes("lidar/points"), "the lidar is a layer that is not shown");
  assert.ok(!(await state(page)).subscribed.includes("control/command"));
  await page.check("#show_points");
  await shows(page, "--points", 30);
  assert.ok((await state(page)).subscribed.includes("lidar/points"));
  await page.uncheck("#show_points");
  assert.ok(!(await state(page)).subscribed.includes("lidar/points"));
  await page.uncheck("#show_plan");
  await page.uncheck("#show_minimal_risk");
  await paint(page);
  assert.equal(await pixels(page, "--plan"), 0);
  assert.ok(!(await state(page)).subscribed.includes("planning/plan"));
  await page.check("#show_plan");
  await page.check("#show_minimal_risk");
  await shows(page, "--plan", 20);
});

test("one can look back, and go on with what is now", async (page) => {
  await page.waitForFunction(() => window.fastcycle.state().newest > 1.5);
  await page.focus("#canvas");
  await page.keyboard.press(" ");
  const { time, isLive, isPlaying } = await state(page);
  assert.deepEqual([isLive, isPlaying], [false, false]);
  await page.keyboard.press("ArrowLeft");
  await page.waitForFunction((to) => Math.abs(window.fastcycle.state().time - to) < 1e-6, time - 0.1);
  await page.keyboard.press("Shift+ArrowLeft");
  await page.waitForFunction((to) => Math.abs(window.fastcycle.state().time - to) < 1e-6, Math.max(0, time - 1.1));
  await page.waitForFunction((newest) => window.fastcycle.state().newest > newest + 0.2, (await state(page)).newest);
  assert.ok(Math.abs((await state(page)).time - Math.max(0, time - 1.1)) < 1e-6, "it stands");
  await says(page, "#time", /s ago/);
  assert.equal(await page.getAttribute("#live", "aria-pressed"), "false");
  await page.click("#play");  // From there on.
  await page.waitForFunction((to) => window.fastcycle.state().time > to, Math.max(0, time - 1.1) + 0.05);
  await page.focus("#canvas");
  await page.keyboard.press("Home");
  await page.waitForFunction(() => !window.fastcycle.state().isPlaying);
  await page.keyboard.press("End");
  await page.waitForFunction(() => window.fastcycle.state().isLive);
  await page.focus("#slider");
  await page.evaluate(() => {
    const slider = document.getElementById("slider");
    slider.value = -1;
    slider.dispatchEvent(new Event("input"));
  });
  assert.equal((await state(page)).isLive, false);
  await page.click("#live");
  assert.equal((await state(page)).isLive, true);
  await page.waitForFunction(() => window.fastcycle.state().newest - window.fastcycle.state().time < 0.5);
});

test("the graph has all components, and says more of one that is chosen", async (page) => {
  await show(page, "graph");
  const { overview } = await ask({ overview: {} });
  const expected = overview.components.map(({ name }) => name).sort();
  await page.waitForFunction((count) => document.querySelectorAll("#graph .component").length === count, expected.length);
  const drawn = await page.$$eval("#graph .component", (all) => all.map((one) => one.dataset.name).sort());
  assert.deepEqual(drawn, expected);
  const topics = await page.$$eval("#graph .topic", (all) => all.map((one) => one.dataset.name));
  assert.ok(topics.includes("planning/plan") && topics.includes("localization/ego"), `${topics}`);
  await page.waitForFunction(() => /\d\/s · p99 .*0 faults/.test(
    document.querySelector('#graph .component[data-name="perception"]').textContent));
  await page.focus('#graph .component[data-name="perception"]');
  await page.keyboard.press("Enter");
  await says(page, "#details", /perception.*callbacks take.*p99/s);
  await page.focus('#graph .topic[data-name="planning/plan"]');
  await page.keyboard.press("Enter");
  await says(page, "#details", /from.*motion_planning.*to.*plan_checker/s);
  await picture(page, "live_page");
});

test("fields of messages are curves: by button, by keyboard and dragged", async (page) => {
  await show(page, "topics");
  await page.fill("#topic_filter", "localization/ego");
  const topic = page.locator("#topics li", { has: page.getByRole("button", { name: "localization/ego", exact: true }) }).first();
  await topic.getByRole("button", { name: "localization/ego", exact: true }).press("Enter");
  const button = topic.getByRole("button", { name: "plot speed_mps" });
  await button.waitFor();
  await button.focus();
  await page.keyboard.press("Enter");
  const values = (plot) => page.waitForFunction((at) => {
    const data = window.fastcycle.plots.plots[at]?.chart.data;
    return data && data.slice(1).every((list) => list.filter((value) => Number.isFinite(value)).length > 10);
  }, plot);
  await values(0);
  await says(page, "#plots .curves", /localization\/ego speed_mps/);
  // Into the same plot, and another field by the mouse.
  await page.selectOption("#plot_target", { label: "plot 1" });
  await topic.getByRole("button", { name: "plot acceleration_mps2" }).click();
  await topic.locator(".field", { hasText: "heading_rad" }).dragTo(page.locator("#plot_zone"));
  await page.waitForFunction(() => window.fastcycle.plots.plots.length === 2);
  await topic.locator(".field", { hasText: "x_m" }).first().dragTo(page.locator(".plot_box").nth(1));
  await page.waitForFunction(() => window.fastcycle.plots.plots[1].curves.length === 2);
  await values(0);
  await values(1);
  assert.deepEqual(await page.evaluate(() => window.fastcycle.plots.plots.map(({ curves }) => curves.map(({ path }) => path.join(".")))),
                   [["speed_mps", "acceleration_mps2"], ["heading_rad", "x_m"]]);
  // A field of a message of a list.
  await page.fill("#topic_filter", "perception/objects");
  const objects = page.locator("#topics > li").first();
  await objects.locator(".topic_name").click();
  await objects.getByRole("button", { name: "objects", exact: true }).click();
  await objects.getByRole("button", { name: "[0]", exact: true }).click();
  await objects.getByRole("button", { name: "plot objects[0].speed_mps" }).waitFor();
  await picture(page, "live_page_topics");
  await objects.locator(".topic_name").click();
  for (let count = await page.locator(".curves button").count(); count > 0; --count) {
    await page.locator(".curves button").first().click();
  }
  assert.equal(await page.locator(".plot_box").count(), 0);
  await page.fill("#topic_filter", "");
});

test("a parameter that is changed on the page changes in the run", async (page) => {
  await show(page, "params");
  const gain = page.locator('[id="param_filter.gain"]');
  const inRun = async (name) => (await ask({ params: { component: "filter" } })).params.params.find((one) => one.name === name).value_json;
  const isSaid = (text) => page.waitForFunction((expected) =>
    document.getElementById("param_filter.gain").closest(".param").querySelector(".origin").textContent === expected, text);
  await gain.waitFor();
  assert.deepEqual([await gain.getAttribute("min"), await gain.getAttribute("max")], ["1", "100"]);
  await gain.fill("7");
  await gain.press("Enter");
  await isSaid("changed");
  assert.equal(await inRun("gain"), "7");
  // What the run does not take is said at its control.
  await gain.fill("1000");
  await gain.press("Enter");
  await page.locator('[id="param_filter.gain_error"]', { hasText: "gain" }).waitFor();
  assert.equal(await gain.getAttribute("aria-invalid"), "true");
  assert.equal(await inRun("gain"), "7");
  await gain.fill("8");
  await gain.press("Enter");
  await page.waitForFunction(() => document.getElementById("param_filter.gain").getAttribute("aria-invalid") === "false");
  assert.equal(await inRun("gain"), "8");
  // One that is set elsewhere is seen here; one that is read at the start cannot be set.
  await ask({ change_params: { changes: [{ param: "filter.limit", value_json: "12.5" }] } });
  await page.waitForFunction(() => document.getElementById("param_filter.limit").value === "12.5");
  assert.equal(await page.isDisabled('[id="param_world.traffic"]'), true);
  await picture(page, "live_page_params");
});

test("a component can be stopped and started", async (page) => {
  await show(page, "components");
  const row = page.locator("#components tbody tr", { hasText: "connectivity" });
  await row.getByRole("button", { name: "stop connectivity" }).click();
  await page.waitForFunction(() => !/active/.test([...document.querySelectorAll("#components tbody tr")]
    .find((line) => line.textContent.startsWith("connectivity")).children[1].textContent));
  const stateOf = async () => (await ask({ overview: {} })).overview.components.find(({ name }) => name === "connectivity").state;
  assert.notEqual(await stateOf(), "active");
  await row.getByRole("button", { name: "start connectivity", exact: true }).click();
  await page.waitForFunction(() => [...document.querySelectorAll("#components tbody tr")]
    .find((line) => line.textContent.startsWith("connectivity")).children[1].textContent === "active");
  assert.equal(await stateOf(), "active");
  await picture(page, "live_page_components");
});

test("of a latency chain it says where the time goes", async (page) => {
  await show(page, "chains");
  await page.waitForFunction(() => document.querySelectorAll("#chains .most").length === 1);
  await says(page, "#chains", /lidar_to_can.*lidar\/points → can\/command: at most 250 ms.*perception.*takes the most/s);
  await picture(page, "live_page_chains");
});

test("it shows the lines of the log from a level on", async (page) => {
  await show(page, "log");
  const count = () => page.locator("#log tr").count();
  await page.selectOption("#log_level", "debug");
  await page.waitForFunction(() => document.querySelectorAll("#log tr").length > 0);
  assert.equal(await page.textContent("#log_problem"), "");
  await page.fill("#log_filter", "no line has this");
  assert.equal(await count(), 0);
  await page.fill("#log_filter", "");
  await page.selectOption("#log_level", "error");
  assert.equal(await page.locator("#log tr:not(.error)").count(), 0);
  await page.selectOption("#log_level", "info");
});

test("the keyboard alone is enough", async (page) => {
  await page.evaluate(() => document.activeElement.blur());
  const seen = new Set();
  let isInTabs = false;
  for (let i = 0; i < 80 && !isInTabs; ++i) {
    await page.keyboard.press("Tab");
    const focus = await page.evaluate(() => {
      if (document.activeElement === document.body) {
        return null;  // Between the last and the first, the focus is the browser's.
      }
      const style = getComputedStyle(document.activeElement);
      return { id: document.activeElement.id, role: document.activeElement.getAttribute("role"),
               ring: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 1 };
    });
    if (!focus) continue;
    assert.ok(focus.ring, `one does not see that ${focus.id} has the focus`);
    seen.add(focus.id);
    isInTabs = focus.role === "tab";
  }
  assert.ok(isInTabs, "no tab has had the focus");
  for (const id of ["theme", "canvas", "follow", "slider", "play", "live", "rate", "plot_target"]) {
    assert.ok(seen.has(id), `${id} is not reached: ${[...seen]}`);
  }
  await page.keyboard.press("Home");
  for (const [i, name] of tabs.entries()) {
    if (i > 0) {
      await page.keyboard.press("ArrowRight");
    }
    assert.equal(await page.evaluate(() => document.activeElement.id), `tab_${name}`);
    assert.equal(await page.getAttribute(`#tab_${name}`, "aria-selected"), "true");
    for (const other of tabs) {
      assert.equal(await page.isVisible(`#panel_${other}`), other === name, other);
    }
  }
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.evaluate(() => document.activeElement.id), "tab_graph");
  assert.equal((await state(page)).isLive, true, "keys of the tabs do not move the time");
  await page.focus("#graph_box");
  await page.evaluate(() => document.getElementById("graph_box").scrollTo(0, 0));
  await page.keyboard.press("ArrowDown");
  await page.waitForFunction(() => document.getElementById("graph_box").scrollTop > 0);
  assert.equal((await state(page)).isLive, true, "what scrolls keeps its keys");
  await page.click("#wide");
  assert.equal(await page.isVisible("#canvas"), false);
  await page.keyboard.press("w");
  assert.equal(await page.isVisible("#canvas"), true);
});

test("all text can be read, in the light and in the dark", async (page) => {
  for (const theme of ["light", "dark"]) {
    assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), theme);
    for (const name of tabs) {
      await show(page, name);
      await paint(page);
      assert.deepEqual(await paleTexts(page), [], `${theme}, ${name}`);
    }
    await show(page, "graph");
    await picture(page, `live_page_${theme}`);
    await page.click("#theme");
  }
});

test("it fits a phone", async (page) => {
  await page.setViewportSize({ width: 390, height: 844 });
  for (const name of tabs) {
    await show(page, name);
    await paint(page);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(wide <= 390, `${name}: ${wide} pixels wide`);
  }
  await page.evaluate(() => scrollTo(0, 0));
  await shows(page, "--road", 1000);
  await shows(page, "--ego", 20);
  for (const id of ["canvas", "play", "live", "slider", "time"]) {
    const box = await (await page.$(`#${id}`)).boundingBox();
    assert.ok(box && box.x >= 0 && box.x + box.width <= 390, `${id} is not in sight`);
  }
  await show(page, "graph");
  await page.evaluate(() => scrollTo(0, 0));
  await picture(page, "live_page_phone");
  await page.setViewportSize({ width: 1280, height: 800 });
});

test("it says that the run has ended", async (page) => {
  await end(first);
  await says(page, "#notice", /connection has ended.*next try/);
  await says(page, "#connection", /^not connected$/);
  await page.close();  // It would try again.
  // That the browser writes of tries that fail is no error of the page.
  problems.splice(0, problems.length, ...problems.filter((one) => !/WebSocket connection|ERR_CONNECTION|Failed to load/.test(one)));
});

test("what the run does not allow cannot be pressed", async (_, open) => {
  const second = await start();
  const other = await open(second.address);
  await show(other, "components");
  const button = other.locator("#components button").first();
  await button.waitFor();
  assert.equal(await other.locator("#components button:not(:disabled)").count(), 0);
  assert.match(await button.getAttribute("title"), /--inspect-allow lifecycle/);
  await show(other, "params");
  await other.locator("#params .param").first().waitFor();
  assert.equal(await other.locator("#params :is(input, select):not(:disabled)").count(), 0);
  await says(other, "#params_allowed", /--inspect-allow params/);
  assert.deepEqual(await paleTexts(other), []);
  await other.close();
  await end(second);
});

test("a recording is played, and moved to any time", async (_, open) => {
  const run = spawn(fastcycle, ["run", application, "--clock", "simulated", "--for", "6s", "--quiet",
                                "--set", "logging.file=to_view.mcap"], { cwd: folder, stdio: "ignore" });
  assert.equal(await new Promise((done) => run.on("exit", done)), 0);
  const viewer = await launch("view", "to_view.mcap", "--live", "127.0.0.1:0", "--paused", "--start", "2s");
  const other = await open(viewer.address);
  const at = (time) => other.waitForFunction((expected) => Math.abs(window.fastcycle.state().time - expected) < 1e-6, time);
  await at(2);
  await says(other, "#connection", /^recording$/);
  await says(other, "#play", /^play$/);
  await shows(other, "--object", 50);
  assert.equal(await other.locator("#tab_params").isVisible(), false);
  await picture(other, "view");

  await other.keyboard.press("ArrowRight");
  await at(2.1);
  await other.keyboard.press("Shift+ArrowLeft");
  await at(1.1);
  await other.fill("#slider", "4.5");
  await at(4.5);
  await shows(other, "--object", 50);
  await other.keyboard.press("Home");
  await at(0);
  await other.selectOption("#rate", "4");
  await other.click("#play");
  await other.waitForFunction(() => window.fastcycle.state().time > 2);
  await other.keyboard.press("End");
  await says(other, "#play", /^play$/);
  await says(other, "#time", /^(6\.\d\d) of \1 s$/);
  assert.deepEqual(await paleTexts(other), []);
  await other.close();
  await end(viewer);
});

// ---- The browser ----

async function picture(page, name) {
  if (pictures) {
    await paint(page);
    await page.screenshot({ path: join(pictures, `${name}.png`) });
  }
}

const browser = await chromium.launch({ executablePath: browserPath, args: ["--no-sandbox", "--disable-gpu"] });
const problems = [];
const open = async (address) => {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: "light" });
  page.setDefaultTimeout(BOUND_MS);
  // That pixels are read often is this test's doing.
  page.on("console", (message) => /getImageData/.test(message.text()) || problems.push(message.text()));
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("request", (request) => new URL(request.url()).origin === new URL(address).origin || /^data:/.test(request.url())
    || problems.push(`asked for ${request.url()}`));
  await page.goto(address);
  await page.waitForFunction(() => window.fastcycle?.state().firstPicture > 0);
  return page;
};

let failed = 0;
try {
  const page = await open(first.address);
  for (const [name, body] of tests) {
    try {
      await body(page, open);
      assert.deepEqual(problems.splice(0), [], "the browser's console");
      console.log(`ok      ${name}`);
    } catch (error) {
      ++failed;
      problems.length = 0;
      console.log(`FAILED  ${name}\n${error.stack}`);
    }
  }
} finally {
  await browser.close();
}
console.log(failed === 0 ? `${tests.length} tests passed` : `${failed} of ${tests.length} tests failed`);
process.exit(failed === 0 ? 0 : 1);
