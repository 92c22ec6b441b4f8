// live_client.mjs FASTCYCLE ADS.json [SECONDS]: npm's Foxglove client connects to a live run of the ADS, and what it
// gets is compared with the recording of that run, as npm's reader of MCAP reads it. Both subprotocols are tried at once:
// the client knows the older one; for the newer one it is notified that it has it. Then the recording is shown by
// `fastcycle view`, played, and moved to other times. Ends with 1 and says what is wrong.
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
const PLAYBACK_STATE = 5;
const PLAYING = 0;
const ENDED = 3;
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

// ---- A client that keeps what it receives ----

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
  states = [];  // Of playback.
  times = 0;
  undecoded = 0;

  constructor(url, subprotocol) {
    const address = url.replace("http", "ws");
    const isNew = subprotocol === "foxglove.sdk.v1";
    this.socket = new (isNew ? NewWebSocket : WebSocket)(address, [subprotocol]);
    this.client = new FoxgloveClient({ ws: this.socket });
    // The client knows nothing of playback.
    this.client.on("error", (error) =>
      /opcode/i.test(String(error)) || this.statuses.push({ level: 2, message: String(error) }));
    this.socket.on("message", (data, isBinary) => {
      const bytes = Buffer.from(data);
      if (isBinary && bytes[0] === PLAYBACK_STATE) {
        const state = {
          status: bytes[1], time: bytes.readBigUInt64LE(2), speed: bytes.readFloatLE(10), didSeek: bytes[14] === 1,
          request: bytes.toString("utf8", 19, 19 + bytes.readUInt32LE(15)) };
        this.states.push(state);
        if (state.didSeek) {
          this.messages.forEach((messages) => (messages.length = 0));
        }
      }
    });
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

// Plays or pauses, and goes to a time if one is given; waits for the state that answers it.
async function control(watcher, request, { pauses = false, speed = 1, seek = null }) {
  const frame = Buffer.alloc(19 + request.length);
  frame[0] = 3;
  frame[1] = pauses ? 1 : 0;
  frame.writeFloatLE(speed, 2);
  frame[6] = seek === null ? 0 : 1;
  frame.writeBigUInt64LE(seek ?? 0n, 7);
  frame.writeUInt32LE(request.length, 15);
  frame.write(request, 19);
  watcher.socket.send(frame);
  return until(`the answer to ${request}`, () => watcher.states.find((state) => state.request === request));
}

// How many messages came, all of them as they are recorded and in that order, and how many did not.
function compare(watcher, log) {
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
  return { compared, missing };
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
                              "--rate", "0.25", "--for", "300s", "--set", "logging.file=live.mcap", "--quiet"],
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

  await new Promise((ready) => setTimeout(ready, seconds * 1000));
  for (const watcher of watchers) {
    await until("the pose", () => watcher.messages.get("localization/ego")?.length > 100);
  }
  run.kill("SIGINT");
  await ended;
  await until("the end", () => watchers.every((watcher) => watcher.isClosed));
  const log = await readLog(join(folder, "live.mcap"));

  for (const watcher of watchers) {
    const { compared, missing } = compare(watcher, log);
    assert.ok(compared > 100, `only ${compared} messages came`);
    console.log(`${watcher.client === first.client ? "foxglove.websocket.v1" : "foxglove.sdk.v1"}: ` +
                `${watcher.channels.size} channels, ${compared} messages equal, ${missing} left out and reported`);
  }
} catch (error) {
  console.error(lines.join("\n"));
  run.kill();
  throw error;
}

// ---- The recording, played ----

const log = await readLog(join(folder, "live.mcap"));
const viewer = spawn(fastcycle, ["view", "live.mcap", "--live", "127.0.0.1:0", "--paused"],
                     { cwd: folder, stdio: ["ignore", "pipe", "inherit"] });
try {
  let address = "";
  createInterface({ input: viewer.stdout }).on("line", (line) => (address ||= line.match(/(http:\S+)/)?.[1] ?? ""));
  await until("the address of the viewer", () => address);
  const watcher = new Watcher(address, "foxglove.sdk.v1");
  await until("the list of channels", () => watcher.channels.size > 10);
  assert.ok(watcher.info.capabilities.includes("playbackControl") && watcher.info.capabilities.includes("time"));
  const nanoseconds = ({ sec, nsec }) => BigInt(sec) * 1_000_000_000n + BigInt(nsec);
  const [begin, end] = [watcher.info.dataStartTime, watcher.info.dataEndTime].map(nanoseconds);
  watcher.subscribeToAll();

  const started = await control(watcher, "play", { speed: 4 });
  assert.deepEqual([started.status, started.speed], [PLAYING, 4]);
  const ended = await until("the end", () => watcher.states.find(({ status }) => status === ENDED));
  assert.equal(ended.time, end);
  await new Promise((ready) => setTimeout(ready, 1500));  // Until what did not come was reported.
  const all = compare(watcher, log);
  assert.ok(watcher.messages.get("localization/ego").length > 100);

  // The last message of each topic before that time, and nothing else, behind the news that it is another time.
  for (const part of [2n, 4n, 3n]) {
    const seek = begin + (end - begin) / part;
    const state = await control(watcher, `seek ${part}`, { pauses: true, seek });
    assert.equal(state.time, seek);
    assert.ok(watcher.states.some(({ didSeek, time }) => didSeek && time === seek));
    for (const topic of ["localization/ego", "planning/plan", "map/tile"]) {
      const before = log.get(topic).filter(([time]) => time <= seek).at(-1);
      const got = await until(`${topic} at ${seek}`, () => watcher.messages.get(topic)[0]);
      assert.deepEqual(got, before, topic);
      assert.equal(watcher.messages.get(topic).length, 1, topic);
    }
  }
  console.log(`view: ${all.compared} messages equal, ${all.missing} left out and reported`);
} finally {
  const over = new Promise((done) => viewer.on("exit", done));
  viewer.kill("SIGINT");
  assert.equal(await over, 0, "how the viewer ended");
}
process.exit(0);
