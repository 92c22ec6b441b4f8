// live_client.mjs FASTCYCLE ADS.json [SECONDS]: npm's Foxglove client connects to a live run of the ADS, and what it
// gets is compared with the recording of that run, as npm's reader of MCAP reads it. Both subprotocols are tried at once:
// the client knows the older one; for the newer one it is told that it has it. Ends with 1 and says what is wrong.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, rmSync } from "node:fs";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";

import { McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import WebSocket from "ws";

const { FoxgloveClient } = createRequire(import.meta.url)("@foxglove/ws-protocol");

const PATIENCE_MS = 120_000;
const [fastcycle, application] = process.argv.slice(2, 4).map((path) => resolve(path));
const seconds = Number(process.argv[4] ?? 8);
const folder = mkdtempSync(join(tmpdir(), "fastcycle_live_"));
process.on("exit", () => rmSync(folder, { recursive: true, force: true }));

const digest = (bytes) => createHash("sha256").update(bytes).digest("hex");

async function until(what, condition) {
  const limit = Date.now() + PATIENCE_MS;
  for (;;) {
    const found = condition();
    if (found) {
      return found;
    }
    assert.ok(Date.now() < limit, `${what} never came`);
    await new Promise((ready) => setTimeout(ready, 10));
  }
}

// ---- A client that keeps what it is told ----

class NewWebSocket extends WebSocket {
  get protocol() {
    return super.protocol === "foxglove.sdk.v1" ? FoxgloveClient.SUPPORTED_SUBPROTOCOL : super.protocol;
  }
}

class Watcher {
  channels = new Map();  // By id.
  services = new Map();  // By name.
  subscriptions = new Map();  // By their id: the channel.
  messages = new Map();  // By topic: [time, digest], in the order in which they came.
  params = new Map();
  replies = new Map();  // By call.
  statuses = [];
  times = 0;
  undecoded = 0;

  constructor(url, subprotocol) {
    const address = url.replace("http", "ws");
    const isNew = subprotocol === "foxglove.sdk.v1";
    this.client = new FoxgloveClient({
      ws: new (isNew ? NewWebSocket : WebSocket)(address, [subprotocol]),
    });
    this.client.on("error", (error) => this.statuses.push({ level: 2, message: String(error) }));
    this.client.on("serverInfo", (info) => (this.info = info));
    this.client.on("status", (status) => this.statuses.push(status));
    this.client.on("time", () => ++this.times);
    this.client.on("advertise", (channels) => channels.forEach((channel) => this.#take(channel)));
    this.client.on("advertiseServices", (all) => all.forEach((one) => this.services.set(one.name, one)));
    this.client.on("parameterValues", ({ parameters }) =>
      parameters.forEach(({ name, value }) => this.params.set(name, value)));
    this.client.on("connectionGraphUpdate", (graph) => (this.graph = graph));
    this.client.on("serviceCallResponse", (reply) => this.replies.set(reply.callId, reply));
    this.client.on("message", ({ subscriptionId, timestamp, data }) => {
      const { topic, type } = this.subscriptions.get(subscriptionId);
      const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
      try {
        type.decode(bytes);
      } catch {
        ++this.undecoded;
      }
      this.messages.get(topic).push([timestamp, digest(bytes)]);
    });
    this.client.on("close", () => (this.isClosed = true));
  }

  #take(channel) {
    assert.equal(channel.encoding, "protobuf", channel.topic);
    const files = descriptor.FileDescriptorSet.decode(Buffer.from(channel.schema, "base64"));
    const type = protobuf.Root.fromDescriptor(files).lookupType(channel.schemaName);
    this.channels.set(channel.id, { ...channel, type });
  }

  subscribeToAll() {
    for (const channel of this.channels.values()) {
      this.messages.set(channel.topic, []);
      this.subscriptions.set(this.client.subscribe(channel.id), channel);
    }
  }
}

// ---- The recording, by npm's reader ----

async function readLog(name) {
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers: await loadDecompressHandlers() });
  const file = await open(name);
  const topics = new Map();
  const found = new Map();  // By topic: digest by time, in the order of the log.
  for (;;) {
    const { bytesRead, buffer } = await file.read(Buffer.alloc(1 << 22), 0, 1 << 22);
    if (bytesRead === 0) {
      break;
    }
    reader.append(buffer.subarray(0, bytesRead));
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Channel") {
        topics.set(record.id, record.topic);
      } else if (record.type === "Message") {
        const topic = topics.get(record.channelId);
        found.set(topic, [...(found.get(topic) ?? []), [record.publishTime, digest(record.data)]]);
      }
    }
  }
  await file.close();
  return found;
}

// ---- The run ----

const run = spawn(fastcycle, ["run", application, "--live", "127.0.0.1:0", "--inspect-allow", "params,publish",
                              "--for", `${seconds}s`, "--set", "logging.file=live.mcap", "--quiet"],
                  { cwd: folder, stdio: ["ignore", "ignore", "pipe"] });
const ended = new Promise((done) => run.on("exit", done));
let url = "";
const lines = [];
createInterface({ input: run.stderr }).on("line", (line) => {
  lines.push(line);
  url ||= line.match(/^live: (http\S+)/)?.[1] ?? "";
});

try {
  await until("the address", () => url);
  const watchers = ["foxglove.websocket.v1", "foxglove.sdk.v1"].map((name) => new Watcher(url, name));
  for (const watcher of watchers) {
    await until("the list of channels", () => watcher.channels.size > 10);
    watcher.subscribeToAll();
  }
  const [first] = watchers;
  assert.equal(first.info.name, "FastCycle ads");

  // Parameters: all, then one is changed.
  first.client.getParameters([], "all");
  await until("the parameters", () => first.params.size > 10);
  const name = [...first.params.keys()].find((one) => one === "control.deadband_mps2") ??
    [...first.params].find(([, value]) => typeof value === "number" && value > 0)[0];
  assert.ok(name, "a parameter that is a number");
  first.client.getParameters([name], "one");
  first.client.subscribeConnectionGraph();
  await until("the graph", () => first.graph);
  const publishers = new Map(first.graph.publishedTopics.map(({ name: topic, publisherIds }) => [topic, publisherIds]));
  assert.ok(publishers.get("localization/ego")?.includes("localization"), "localization publishes its pose");

  await ended;
  await until("the end", () => watchers.every((watcher) => watcher.isClosed));
  const log = await readLog(join(folder, "live.mcap"));

  for (const watcher of watchers) {
    assert.equal(watcher.undecoded, 0, "messages that the schema does not decode");
    const excused = watcher.statuses.map(({ message }) => message);
    let compared = 0;
    let missing = 0;
    for (const [topic, got] of watcher.messages) {
      const recorded = log.get(topic);
      if (!recorded || got.length === 0) {
        continue;
      }
      const at = new Map(recorded.map(([time, bytes], i) => [`${time} ${bytes}`, i]));
      let last = -1;
      let lost = 0;
      for (const [time, bytes] of got) {
        const place = at.get(`${time} ${bytes}`);
        assert.ok(place !== undefined, `${topic}: a message of ${time} is not in the recording, or is another one`);
        assert.ok(place > last, `${topic}: a message came twice or in another order`);
        lost += last < 0 ? 0 : place - last - 1;
        last = place;
        ++compared;
      }
      assert.ok(lost === 0 || excused.some((text) => text.startsWith(`${topic}: `)),
                `${topic}: ${lost} messages did not come, and no status says so`);
      missing += lost;
    }
    assert.ok(compared > 100, `only ${compared} messages came`);
    console.log(`${watcher.client === first.client ? "foxglove.websocket.v1" : "foxglove.sdk.v1"}: ` +
                `${watcher.channels.size} channels, ${compared} messages equal, ${missing} left out and told`);
  }
} catch (error) {
  console.error(lines.join("\n"));
  run.kill();
  throw error;
}
process.exit(0);
