// A recording that is played, and can be moved to any of its times: what the server reports of it, and how it is commanded
// what to do.
import { element } from "../controls.js";
import { say } from "./rows.js";

export const PLAYING = 0;
export const PAUSED = 1;

export class Playback {
  #isAsked = false;
  #next = null;  // What is asked for when the answer to the last request is there.
  #requests = 0;

  // `moved(time)` is called when it was moved to another time.
  constructor(connection, clock, moved) {
    Object.assign(this, { connection, clock, moved });
    this.isThere = false;
    this.isPlaying = false;
    this.length = 0;  // Seconds.
    this.speed = 1;
    element("rate").addEventListener("change", () => this.isThere && this.#ask({ speed: Number(element("rate").value) }));
  }

  // A connection is there, with what the server says of itself.
  opened(info) {
    this.isThere = info.capabilities.includes("playbackControl") && info.metadata?.playback === "any time";
    this.#isAsked = false;
    this.#next = null;
    element("main").classList.toggle("recording", this.isThere);
    if (this.isThere) {
      const ns = ({ sec, nsec }) => BigInt(sec) * 1_000_000_000n + BigInt(nsec);
      this.begin = ns(info.dataStartTime);
      this.clock.begin(this.begin);
      this.length = Number(ns(info.dataEndTime) - this.begin) / 1e9;
    }
  }

  // What the server says of it.
  take({ status, now, speed, didSeek, request }) {
    if (!this.isThere) {
      return;
    }
    this.isPlaying = this.#next?.plays ?? status === PLAYING;
    this.speed = speed;
    const time = this.clock.toTime(now);
    if (didSeek) {
      this.moved(time);
    }
    this.clock.newest = time;
    if (request !== "") {
      this.#isAsked = false;
      if (this.#next) {
        const next = this.#next;
        this.#next = null;
        this.#ask(next);
      }
    }
    this.#showRate();
  }

  tick(ns) {
    if (this.isThere) this.clock.newest = this.clock.toTime(ns);
  }

  play(plays) {
    this.#ask({ plays });
  }

  // Goes on playing if it does, or as `plays` says.
  seek(time, plays = this.isPlaying) {
    this.#ask({ plays, seek: Math.min(this.length, Math.max(0, time)) });
  }

  // Of many that come before the server has answered, as while a slider is drawn, the last counts.
  #ask(change) {
    this.isPlaying = change.plays ?? this.isPlaying;
    if (this.#isAsked) {
      this.#next = { ...this.#next, ...change };
      return;
    }
    this.#isAsked = this.connection.control({
      pauses: !this.isPlaying, speed: change.speed ?? this.speed,
      seek: change.seek === undefined ? null : this.begin + BigInt(Math.round(change.seek * 1e9)),
      request: String(++this.#requests),
    });
  }

  #showRate() {
    const rate = element("rate");
    const value = String(Number(this.speed.toPrecision(4)));
    if (![...rate.options].some((option) => option.value === value)) {
      rate.append(new Option(`${value}×`, value));
    }
    rate.value = value;
  }

  showTime(time) {
    const slider = element("slider");
    slider.min = 0;
    slider.max = this.length;
    slider.value = time;
    const text = `${time.toFixed(2)} of ${this.length.toFixed(2)} s`;
    say(element("time"), text);
    slider.setAttribute("aria-valuetext", text);
  }
}
