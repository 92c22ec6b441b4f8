// The connection to a run: the Foxglove WebSocket protocol, as far as this page needs it, and questions by POST /ask.
// docs/reference/live.md has both.

const SUBPROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const MESSAGE_DATA = 1;
const TIME = 2;
const PLAYBACK_STATE = 5;
const CONTROL_PLAYBACK = 3;  // Of the client.
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 10_000;

// Why a question has no answer, in words for people.
export class AskError extends Error {}

export class Connection {
  #subscriptions = new Map();  // By topic: { id, channel, listeners }.
  #topicOf = new Map();  // By number of a subscription.
  #nextId = 1;
  #wait = FIRST_WAIT_MS;
  #socket = null;

  // `listener` has opened(info, isAnother), closed(why, waitMs), channels(), time(ns), status(level, text), graph(json),
  // playback({ status, now, speed, didSeek, request }).
  constructor(listener) {
    this.listener = listener;
    this.token = new URLSearchParams(location.search).get("token") ?? "";
    this.channels = new Map();  // By topic.
    this.session = null;
    this.isOpen = false;
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/?token=${encodeURIComponent(this.token)}`, SUBPROTOCOLS);
    this.#socket = socket;
    socket.binaryType = "arraybuffer";
    socket.addEventListener("message", ({ data }) => {
      if (typeof data === "string") {
        this.#takeText(JSON.parse(data));
      } else {
        this.#takeBinary(data);
      }
    });
    socket.addEventListener("close", () => {
      const wasOpen = this.isOpen;
      this.isOpen = false;
      const wait = this.#wait;
      this.#wait = Math.min(LONGEST_WAIT_MS, 2 * wait);
      this.listener.closed(wasOpen, wait);
      this.retry = setTimeout(() => this.open(), wait);
    });
  }

  // Tries again at once.
  hurry() {
    if (!this.isOpen && this.#socket?.readyState === WebSocket.CLOSED) {
      clearTimeout(this.retry);
      this.#wait = FIRST_WAIT_MS;
      this.open();
    }
  }

  // `take(time_ns, payload)` receives the messages of a topic from now on. Returns what ends that.
  subscribe(topic, take) {
    let subscription = this.#subscriptions.get(topic);
    if (!subscription) {
      subscription = { id: 0, listeners: new Set() };
      this.#subscriptions.set(topic, subscription);
    }
    subscription.listeners.add(take);
    // Who comes later to a latched topic would not get what there is: the server gives it to a new subscription.
    if (subscription.listeners.size > 1) {
      this.#end(subscription);
    }
    this.#begin(topic, subscription);
    return () => {
      subscription.listeners.delete(take);
      if (subscription.listeners.size === 0) {
        this.#end(subscription);
        this.#subscriptions.delete(topic);
      }
    };
  }

  #begin(topic, subscription) {
    const channel = this.channels.get(topic);
    if (!this.isOpen || !channel || subscription.id !== 0) {
      return;
    }
    subscription.id = this.#nextId++;
    this.#topicOf.set(subscription.id, topic);
    this.#say({ op: "subscribe", subscriptions: [{ id: subscription.id, channelId: channel.id }] });
  }

  #end(subscription) {
    if (subscription.id !== 0) {
      this.#topicOf.delete(subscription.id);
      if (this.isOpen) {
        this.#say({ op: "unsubscribe", subscriptionIds: [subscription.id] });
      }
      subscription.id = 0;
    }
  }

  // Which topics messages are asked of, now.
  subscribed() {
    return [...this.#topicOf.values()];
  }

  #say(json) {
    if (this.#socket.readyState === WebSocket.OPEN) {
      this.#socket.send(JSON.stringify(json));
    }
  }

  #takeText(json) {
    switch (json.op) {
      case "serverInfo": {
        const isAnother = this.session !== null && this.session !== json.sessionId;
        this.session = json.sessionId;
        this.isOpen = true;
        this.#wait = FIRST_WAIT_MS;
        this.channels.clear();
        this.#topicOf.clear();
        this.#subscriptions.forEach((subscription) => (subscription.id = 0));
        this.listener.opened(json, isAnother);
        this.#say({ op: "subscribeConnectionGraph" });
        return;
      }
      case "advertise":
        for (const channel of json.channels) {
          this.channels.set(channel.topic, channel);
        }
        this.listener.channels();
        this.#subscriptions.forEach((subscription, topic) => this.#begin(topic, subscription));
        return;
      case "unadvertise":
        for (const [topic, { id }] of this.channels) {
          if (json.channelIds.includes(id)) this.channels.delete(topic);
        }
        this.listener.channels();
        return;
      case "status":
        this.listener.status(json.level, json.message);
        return;
      case "connectionGraphUpdate":
        this.listener.graph(json);
        return;
    }
  }

  #takeBinary(buffer) {
    const view = new DataView(buffer);
    if (view.getUint8(0) === MESSAGE_DATA) {
      const topic = this.#topicOf.get(view.getUint32(1, true));
      const time = view.getBigUint64(5, true);
      const payload = new Uint8Array(buffer, 13);
      this.#subscriptions.get(topic)?.listeners.forEach((take) => take(time, payload));
    } else if (view.getUint8(0) === TIME) {
      this.listener.time(view.getBigUint64(1, true));
    } else if (view.getUint8(0) === PLAYBACK_STATE) {
      this.listener.playback({
        status: view.getUint8(1), now: view.getBigUint64(2, true), speed: view.getFloat32(10, true),
        didSeek: view.getUint8(14) !== 0,
        request: new TextDecoder().decode(new Uint8Array(buffer, 19, view.getUint32(15, true))) });
    }
  }

  // Steers a recording that is played; `seek` is a time in nanoseconds, or null. False: there is no connection.
  control({ pauses, speed, seek, request }) {
    if (this.#socket?.readyState !== WebSocket.OPEN) {
      return false;
    }
    const name = new TextEncoder().encode(request);
    const frame = new DataView(new ArrayBuffer(19 + name.length));
    frame.setUint8(0, CONTROL_PLAYBACK);
    frame.setUint8(1, pauses ? 1 : 0);
    frame.setFloat32(2, speed, true);
    frame.setUint8(6, seek === null ? 0 : 1);
    frame.setBigUint64(7, seek ?? 0n, true);
    frame.setUint32(15, name.length, true);
    new Uint8Array(frame.buffer).set(name, 19);
    this.#socket.send(frame.buffer);
    return true;
  }

  // The answer to a request of messages/inspect/inspect.proto: what it has under `expected`.
  // Throws an AskError.
  async ask(request, expected) {
    let answer;
    try {
      const response = await fetch("/ask", {
        method: "POST",
        headers: { Authorization: `Bearer ${this.token}`, "Content-Type": "application/json" },
        body: JSON.stringify(request),
      });
      if (!response.ok) {
        throw new AskError(`The run does not answer questions of this page (HTTP ${response.status}).`);
      }
      answer = await response.json();
    } catch (error) {
      throw error instanceof AskError ? error : new AskError("The run does not answer.");
    }
    if (answer.error) {
      const { text, hint } = answer.error;
      throw new AskError([text, hint].filter(Boolean).join(" — "));
    }
    if (!answer[expected]) {
      throw new AskError(`The run answered something else than "${expected}".`);
    }
    return answer[expected];
  }
}
