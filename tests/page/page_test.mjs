// page_test.mjs FASTCYCLE ADS.json NODE_MODULES [PICTURES]: records a drive in simulated time, makes a page of it and
// looks at that in a browser: at what it says, at its pixels and at its own state. With PICTURES, a folder, it leaves
// pictures there. Ends with 77 and says why where there is no browser to look with.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, statSync, truncateSync, copyFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [fastcycle, application, nodeModules, pictures] = process.argv.slice(2).map((path) => resolve(path));

function skip(reason) {
  console.log(`page: skipped: ${reason}`);
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

const folder = mkdtempSync(join(tmpdir(), "fastcycle_page_"));
process.on("exit", () => rmSync(folder, { recursive: true, force: true }));
const at = (name) => join(folder, name);

function run(...words) {
  return spawnSync(fastcycle, words, { cwd: folder, encoding: "utf8", timeout: 240_000 });
}

// ---- The page ----

execFileSync(fastcycle, ["run", application, "--clock", "simulated", "--quiet"], { cwd: folder, stdio: "ignore" });
const drive = "recording.mcap";

const done = run("render", drive, "-o", "drive.html");
assert.equal(done.status, 0, done.stderr);
assert.match(done.stdout, /^drive\.html: .* MB, \d+ messages\n$/);
assert.ok(statSync(at("drive.html")).size < 10e6, "it is no small page");

const tests = [];
const test = (name, body) => tests.push([name, body]);
const state = (page) => page.evaluate(() => window.fastcycle.state());
const seek = async (page, time) => {
  await page.evaluate((to) => window.fastcycle.seek(to), time);
  // The slider has steps of 0.01 s, and its end is the last one before that of the drive.
  await page.waitForFunction((to) => Math.abs(Number(document.getElementById("slider").value) - to) < 0.011, time);
};

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

const paint = (page) => page.evaluate(() => new Promise((ready) =>
  requestAnimationFrame(() => requestAnimationFrame(ready))));

test("it shows lanes, the vehicle, objects and plan", async (page) => {
  await seek(page, 10);
  await paint(page);
  assert.ok((await state(page)).objects > 3, "objects");
  for (const [color, least] of [["--road", 5000], ["--edge", 500], ["--ego", 30], ["--object", 50],
                                ["--velocity", 20], ["--plan", 50], ["--risk", 20]]) {
    const count = await pixels(page, color);
    assert.ok(count >= least, `${color}: ${count} pixels, expected ${least}`);
  }
  assert.equal(await page.textContent("#state"), "engaged");
});

test("it shows the goal when the vehicle comes to it", async (page) => {
  await seek(page, 13.5);
  await paint(page);
  const goal = await pixels(page, "--goal");
  assert.ok(goal > 20, `${goal} pixels`);
  await page.uncheck("#show_goal");
  await paint(page);
  assert.equal(await pixels(page, "--goal"), 0);
  await page.check("#show_goal");
});

test("a layer that is switched off is not drawn", async (page) => {
  await page.uncheck("#show_objects");
  await page.uncheck("#show_plan");
  await paint(page);
  assert.equal(await pixels(page, "--plan"), 0);
  await page.check("#show_objects");
  await page.check("#show_plan");
  await paint(page);
  assert.ok((await pixels(page, "--plan")) > 0);
});

test("the vehicle and the objects move with the time", async (page) => {
  const place = () => page.evaluate(() => window.fastcycle.drive.egoAt(window.fastcycle.state().time));
  await seek(page, 4);
  const early = await place();
  await seek(page, 8);
  const late = await place();
  assert.ok(Math.hypot(late.x - early.x, late.y - early.y) > 5);
  // Between two messages an object moves evenly: in a fifth of the time by a fifth of the way, however far the next
  // message has it.
  const [compared, largest] = await page.evaluate(() => {
    const { drive } = window.fastcycle;
    const messages = drive.messagesOf("objects").filter(({ time }) => time > 5 && time < 9);
    let [compared, largest] = [0, 0];
    messages.slice(1).forEach((next, i) => {
      const last = messages[i];
      const later = new Map(next.objects.map((object) => [object.id, object]));
      for (const part of [0.2, 0.4, 0.6, 0.8]) {
        const shown = new Map(drive.objectsAt(last.time + part * (next.time - last.time)).map((object) => [object.id, object]));
        for (const from of last.objects.filter(({ id }) => later.has(id))) {
          const [to, at] = [later.get(from.id), shown.get(from.id)];
          const [x, y] = ["x", "y"].map((axis) => from[axis] + part * (to[axis] - from[axis]));
          largest = Math.max(largest, at ? Math.hypot(at.x - x, at.y - y) : Infinity);
          ++compared;
        }
      }
    });
    return [compared, largest];
  });
  assert.ok(compared > 100, `${compared} places between messages`);
  assert.ok(largest < 1e-6, `an object is shown ${largest} m from its way between two messages`);
});

test("the slider, the buttons and the keys move the time", async (page) => {
  await page.fill("#slider", "3");
  await page.waitForFunction(() => window.fastcycle.state().time === 3);
  await page.focus("#canvas");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => Math.abs(window.fastcycle.state().time - 3.1) < 1e-9);
  await page.keyboard.press("Shift+ArrowLeft");
  await page.waitForFunction(() => Math.abs(window.fastcycle.state().time - 2.1) < 1e-9);
  await page.click("#begin");
  await page.waitForFunction(() => window.fastcycle.state().time === 0);
  await page.focus("#canvas");
  await page.keyboard.press("End");
  await page.waitForFunction(() => window.fastcycle.state().time === window.fastcycle.drive.duration);
});

test("it plays, at another speed as well, and stops at the end", async (page) => {
  await seek(page, 0);
  await page.focus("#canvas");
  await page.keyboard.press("ArrowUp");
  assert.equal((await state(page)).rate, 2);
  await page.keyboard.press(" ");
  await page.waitForFunction(() => window.fastcycle.state().time > 0.5);
  assert.equal(await page.textContent("#play"), "pause");
  await page.click("#play");
  assert.equal((await state(page)).isPlaying, false);
  await page.evaluate(() => window.fastcycle.seek(window.fastcycle.drive.duration - 0.05));
  await page.click("#play");
  await page.waitForFunction(() => !window.fastcycle.state().isPlaying);
  assert.equal(await page.textContent("#play"), "play");
});

test("one can zoom, move, follow and turn", async (page) => {
  await seek(page, 6);
  const canvas = await (await page.$("#canvas")).boundingBox();
  const [x, y] = [canvas.x + canvas.width / 2, canvas.y + canvas.height / 2];
  const before = (await state(page)).camera;
  await page.mouse.move(x, y);
  await page.mouse.wheel(0, -200);
  await page.waitForFunction((scale) => window.fastcycle.state().camera.scale > scale, before.scale);
  await page.mouse.down();
  await page.mouse.move(x + 60, y + 20);
  await page.mouse.up();
  assert.equal((await state(page)).camera.follows, false);
  assert.notEqual((await state(page)).camera.x, before.x);
  await page.click("#follow");
  assert.equal((await state(page)).camera.follows, true);
  await page.click("#turn");
  await paint(page);
  assert.notEqual((await state(page)).camera.angle, 0);
  await page.click("#turn");
});

test("curves have values, and a click in one goes there", async (page) => {
  const curves = await page.evaluate(() => window.fastcycle.plots.plots.map((plot) => ({
    labels: plot.series.slice(1).map((series) => series.label),
    values: plot.data.slice(1).map((values) => values.filter((value) => value !== null && value !== undefined).length),
  })));
  assert.deepEqual(curves.map(({ labels }) => labels), [
    ["vehicle", "plan"], ["nearest", "of the plan"], ["objects", "predictions", "plan"], ["vehicle", "command"]]);
  for (const { labels, values } of curves) {
    assert.ok(values.every((count) => count > 50), `${labels}: ${values} values`);
  }
  const over = await (await page.$(".plot .u-over")).boundingBox();
  await page.mouse.click(over.x + over.width / 2, over.y + over.height / 2);
  const { time } = await state(page);
  const { duration } = await page.evaluate(() => ({ duration: window.fastcycle.drive.duration }));
  assert.ok(Math.abs(time - duration / 2) < 0.5, `${time} s`);
});

test("events lead to where they happened", async (page) => {
  const changes = await page.evaluate(() => window.fastcycle.changes);
  assert.ok(changes.some((change) => change.state === "ENGAGED"), "it drives by itself");
  assert.equal(await page.locator("#events li").count(), changes.length);
  await page.locator("#events button").nth(1).click();
  assert.equal((await state(page)).time, changes[1].time);
});

test("it is light or dark, as one likes", async (page) => {
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await ground();
  await page.click("#theme");
  assert.notEqual(await ground(), light);
  await page.click("#theme");
  assert.equal(await ground(), light);
});

test("it fits a phone", async (page) => {
  await page.setViewportSize({ width: 390, height: 844 });
  await seek(page, 8);
  await paint(page);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `${wide} pixels wide`);
  for (const id of ["canvas", "play", "slider", "time", "rate"]) {
    const box = await (await page.$(`#${id}`)).boundingBox();
    assert.ok(box && box.x >= 0 && box.x + box.width <= 390 && box.y + box.height <= 844, `${id} is not in sight`);
  }
  assert.ok((await pixels(page, "--road")) > 2000);
  await picture(page, "page_phone");
  await page.setViewportSize({ width: 1120, height: 700 });
  await paint(page);
});

test("points of the lidar are drawn where they are recorded", async (page, open) => {
  // It is not recorded by default. What was recorded before keeps its name.
  writeFileSync(at("lidar.json"), JSON.stringify({
    components: [{ name: "logging", params: { except: ["world/scene", "prediction/*"] } }] }));
  execFileSync(fastcycle, ["run", application, "--overlay", "lidar.json", "--clock", "simulated", "--quiet", "--for",
                           "6s"], { cwd: folder, stdio: "ignore" });
  const made = run("render", "recording_0002.mcap", "-o", "lidar.html");
  assert.equal(made.status, 0, made.stderr);
  assert.match(made.stderr, /not shown: predictions \(prediction\/objects\): no messages/);
  assert.ok(statSync(at("lidar.html")).size < 10e6, `${statSync(at("lidar.html")).size} bytes`);
  const other = await open("lidar.html");
  await seek(other, 5);
  await paint(other);
  await picture(other, "page_lidar");
  const returns = await pixels(other, "--points");
  assert.ok(returns > 30, `${returns} pixels`);
  await other.uncheck("#show_points");
  await paint(other);
  assert.ok((await pixels(other, "--points")) < returns / 10);
  // Echoes of the boxes' sides are at their boxes.
  const near = await other.evaluate(() => {
    const { drive } = window.fastcycle;
    const points = drive.pointsAt(5);
    return drive.objectsAt(5).filter(({ x, y }) => {
      for (let i = 0; i < points.length; i += 3) {
        if (points[i + 2] > 0.3 && Math.hypot(points[i] - x, points[i + 1] - y) < 4) return true;
      }
      return false;
    }).length;
  });
  assert.ok(near > 2, `${near} objects have returns`);
  await other.close();
});

test("borders of the road are drawn beside the way of the vehicle", async (page, open) => {
  const data = join(process.env.FASTCYCLE_DATA ?? "/nowhere", "kitti_0005_lidar_labels");
  if (!existsSync(data)) {
    console.log(`page: borders are not looked at: no ${data}; FASTCYCLE_DATA names the folder of recorded data`);
    return;
  }
  const kitti = join(dirname(application), "applications", "kitti", "kitti.json");
  execFileSync(fastcycle, ["run", kitti, "--var", `data=${data}`, "--record", "street.mcap", "--clock", "simulated",
                           "--quiet", "--for", "1s"], { cwd: folder, stdio: "ignore" });
  const made = run("render", "street.mcap");
  assert.equal(made.status, 0, made.stderr);
  const other = await open("street.html");
  await seek(other, 0.9);
  await paint(other);
  const seen = await pixels(other, "--border");
  assert.ok(seen > 30, `${seen} pixels`);
  await other.uncheck("#show_borders");
  await paint(other);
  assert.ok((await pixels(other, "--border")) < seen / 10);
  assert.ok((await pixels(other, "--unknown")) > 100, "walls and bushes are outlines");
  // What does not change is a line in the middle: in simulated time no component here takes any.
  const flat = await other.evaluate(() => window.fastcycle.plots.plots.flatMap((plot) => {
    const there = plot.data.slice(1).flat().filter((value) => value !== null && value !== undefined);
    const { min, max } = plot.scales.y;
    return Math.max(...there) === Math.min(...there) ? [(max - min) / 2, there[0] - (min + max) / 2] : [];
  }));
  assert.deepEqual(flat, [10, 0, 0.1, 0]);  // ms of latency, m/s² of acceleration
  // The vehicle drives between them: on its left, and on its right.
  const sides = await other.evaluate(() => {
    const { drive } = window.fastcycle;
    const ego = drive.egoAt(0.9);
    return drive.bordersAt(0.9).map(([x, y]) =>
      (y - ego.y) * Math.cos(ego.heading) - (x - ego.x) * Math.sin(ego.heading)).filter((left) => Math.abs(left) < 15);
  });
  assert.ok(sides.some((left) => left > 1) && sides.some((left) => left < -1), `${sides}`);
  await other.close();
});

test("a view of a few fields shows these", async (page, open) => {
  const layers = {
    ego: { topic: "localization/ego", fields: { x: "x_m", y: "y_m" } },
    objects: { topic: "perception/objects", fields: { objects: { from: "objects", fields: { id: "id", x: "x_m", y: "y_m" } } } },
  };
  writeFileSync(at("few.json"), JSON.stringify({ layers }));
  const made = run("render", drive, "--view", "few.json", "-o", "few.html");
  assert.equal(made.status, 0, made.stderr);
  const other = await open("few.html");
  await seek(other, 8);
  await paint(other);
  assert.match(await other.textContent("#readout"), /^\d+ objects$/);
  const { width, height } = other.viewportSize();
  await other.mouse.move(width / 4, height / 2);
  await other.close();
});

test("points are shown where no place of the vehicle is known", async (page, open) => {
  const view = JSON.parse(readFileSync(new URL("../../tools/page/ads.json", import.meta.url), "utf8").replace(/^ *\/\/.*$/gm, ""));
  writeFileSync(at("points.json"), JSON.stringify({ layers: { points: view.layers.points } }));
  const made = run("render", "recording_0002.mcap", "--view", "points.json", "-o", "points.html");
  assert.equal(made.status, 0, made.stderr);
  const other = await open("points.html");
  await seek(other, 5);
  await paint(other);
  assert.ok((await pixels(other, "--points")) > 30);
  assert.equal(await other.isVisible("#readout"), false, "there is nothing to read");
  await other.close();
});

test("what is no number is not shown, and all the rest is", async (page, open) => {
  // As `fastcycle render` writes what is not finite.
  const [before, data, after] = readFileSync(at("drive.html"), "utf8").split(/(?<=id="data">)(.*?)(?=<\/script>)/s);
  const json = JSON.parse(data);
  const forget = (values) => values.forEach((value, i) => {
    if (Array.isArray(value)) forget(value);
    else if (typeof value === "number") values[i] = null;
  });
  for (const layer of Object.values(json.layers)) {
    layer.messages.slice(-5).forEach((message) => message.slice(1).forEach((value, i) => {
      if (Array.isArray(value)) forget(value);
      else message[i + 1] = typeof value === "number" && layer.names[i] !== "time" ? null : value;
    }));
  }
  writeFileSync(at("null.html"), before + JSON.stringify(json) + after);
  const other = await open("null.html");
  for (const time of [json.duration, json.duration - 0.3, 8]) {
    await seek(other, time);
    await paint(other);
  }
  assert.ok((await state(other)).objects > 3);
  await other.close();
});

test("what is wrong is said", async () => {
  const wrong = (expected, text, ...words) => {
    const { status, stderr } = run("render", ...words);
    assert.equal(status, expected, stderr);
    assert.match(stderr, text);
  };
  wrong(1, /nothing\.mcap/, "nothing.mcap");
  wrong(1, /drive\.html: expected a name that is free/, drive, "-o", "drive.html");
  wrong(1, /the log ends before that/, drive, "--start", "60s", "-o", "x.html");
  wrong(2, /--start/, drive, "--start", "soon");
  wrong(2, /--end expects a time after --start/, drive, "--start", "3s", "--end", "2s");
  writeFileSync(at("wrong.json"), '{"layers": {"ego": {"topic": 7}}}');
  wrong(2, /wrong\.json: \/layers\/ego\/topic: expected a name, found 7/, drive, "--view", "wrong.json", "-o", "x.html");
  writeFileSync(at("other.json"), '{"layers": {"ego": {"topic": "no/topic", "fields": {"x": "x_m"}}}}');
  wrong(1, /nothing to draw: the log has .*localization\/ego.*; ego \(no\/topic\): no messages/, drive, "--view", "other.json", "-o", "x.html");
  writeFileSync(at("field.json"), '{"layers": {"ego": {"topic": "localization/ego", "fields": {"x": "x_km"}}}}');
  wrong(1, /localization\.Ego has no field x_km/, drive, "--view", "field.json", "-o", "x.html");
  // Half of it: what there is is shown, and it is said where it ends.
  copyFileSync(at(drive), at("half.mcap"));
  truncateSync(at("half.mcap"), Math.floor(statSync(at(drive)).size / 2));
  wrong(0, /half\.mcap: .*the readable part was used/, "half.mcap");
  const bytes = readFileSync(at(drive));
  bytes.fill(0, Math.floor(bytes.length / 2), Math.floor(bytes.length / 2) + 4096);  // More than what is between chunks.
  writeFileSync(at("bad.mcap"), bytes);
  wrong(1, /bad\.mcap: byte \d+: .*expected/, "bad.mcap");
  writeFileSync(at("none.mcap"), "this is no log");
  wrong(1, /none\.mcap/, "none.mcap");
  assert.ok(!existsSync(at("x.html")) && !existsSync(at("none.html")) && !existsSync(at("bad.html")));
});

test("a comparison shows both drives, and what differs", async (page, open) => {
  // With so few ways to choose from the vehicle is driven another way.
  const words = ["compare", drive, application, "--continue-with", "new", "--set", "motion_planning.beam=8",
                 "--set", "motion_planning.horizon_min_s=2", "--set", "motion_planning.horizon_max_s=3"];
  const made = run(...words, "--page", "both.html", "--report", "both.json");
  assert.equal(made.status, 3, made.stderr);
  assert.match(made.stdout, /^planning\/plan +\d+ +[1-9]\d*/m);
  const other = await open("both.html");
  await seek(other, 12);
  await paint(other);
  const drawn = await pixels(other, "--new");
  assert.ok(drawn > 100, `${drawn} pixels of the new drive`);
  await other.uncheck("#show_new");
  await paint(other);
  assert.ok((await pixels(other, "--new")) < drawn / 10);
  await other.check("#show_new");
  const labels = await other.evaluate(() => window.fastcycle.plots.plots[0].series.slice(1).map(({ label }) => label));
  assert.deepEqual(labels, ["vehicle", "plan", "vehicle (new)", "plan (new)"]);
  // The list leads to where the largest change is.
  const { topics } = JSON.parse(readFileSync(at("both.json"), "utf8"));
  const plans = topics.find(({ topic }) => topic === "planning/plan");
  const field = plans.fields.find((one) => one.max_at);
  const row = other.locator("#differences tr", { hasText: "planning/plan" });
  assert.match(await row.textContent(), new RegExp(`${plans.different} of ${plans.compared}`));
  await other.locator("#differences button", { hasText: field.field }).first().click();
  await paint(other);
  await picture(other, "page_both");
  assert.equal(await page.isVisible("#differences_title"), false);
  await other.setViewportSize({ width: 390, height: 844 });
  await paint(other);
  assert.ok((await other.evaluate(() => document.documentElement.scrollWidth)) <= 390);
  await other.close();
});

test("it shows the log's lines until the time", async (page, open) => {
  writeFileSync(at("log.json"), JSON.stringify({
    components: [{ name: "logging", params: { file: "log.mcap", topics: ["**", "fastcycle/log"] } }] }));
  const recorded = run("run", application, "--overlay", "log.json", "--clock", "simulated", "--quiet", "--for", "6s");
  assert.equal(recorded.status, 0, recorded.stderr);
  const made = run("render", "log.mcap", "-o", "log.html");
  assert.equal(made.status, 0, made.stderr);
  assert.doesNotMatch(made.stderr, /not shown: log/);
  const other = await open("log.html");
  const first = await other.evaluate(() => window.fastcycle.drive.layers.log.published[0]);
  const count = await other.evaluate(() => window.fastcycle.drive.layers.log.count);
  const rows = () => other.$$eval("#log tr", (lines) => lines.map((line) => line.children.length));
  await seek(other, Math.max(0, first));
  await paint(other);
  assert.ok((await rows()).every((cells) => cells === 4) && (await rows()).length > 0);
  await other.evaluate(() => window.fastcycle.seek(1e6));
  await paint(other);
  assert.equal((await rows()).length, Math.min(12, count));
  assert.equal(await other.isVisible("#log_title"), true);
  assert.equal(await page.isVisible("#log_title"), false);
  await other.close();
});

// ---- The browser ----

async function picture(page, name) {
  if (pictures) {
    await page.screenshot({ path: join(pictures, `${name}.png`) });
  }
}

const browser = await chromium.launch({ executablePath: browserPath, args: ["--no-sandbox", "--disable-gpu"] });
const problems = [];
const open = async (file, hash = "") => {
  const page = await browser.newPage({ viewport: { width: 1120, height: 700 }, colorScheme: "light" });
  // That pixels are read often is this test's doing.
  page.on("console", (message) => /getImageData/.test(message.text()) || problems.push(message.text()));
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("request", (request) => /^(file|data):/.test(request.url()) || problems.push(`asked for ${request.url()}`));
  await page.goto(pathToFileURL(at(file)).href + hash);
  await page.waitForFunction(() => window.fastcycle?.state().frames > 0);
  return page;
};

let failed = 0;
try {
  const page = await open("drive.html", "#8");
  assert.equal((await state(page)).time, 8);
  await picture(page, "page");
  await page.click("#theme");
  await paint(page);
  await picture(page, "page_dark");
  await page.click("#theme");
  for (const [name, body] of tests) {
    try {
      await body(page, open);
      assert.deepEqual(problems.splice(0), [], "the browser's console");
      console.log(`ok      ${name}`);
    } catch (error) {
      ++failed;
      console.log(`FAILED  ${name}\n${error.stack}`);
    }
  }
} finally {
  await browser.close();
}
console.log(failed === 0 ? `${tests.length} tests passed` : `${failed} of ${tests.length} tests failed`);
process.exit(failed === 0 ? 0 : 1);
