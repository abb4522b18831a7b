// Commands of the operator. STOP is sent again after each reconnection; a failure is shown until the rig answers.
"use strict";

const STOP_MS = 5000; // time for which an unsent STOP is tried again
const OLD_MS = 20_000; // time after which the outcome of a successful command is hidden, as the rig's state may have changed
const WANTED = { STOP: ["FAULT"], DISARM: ["DISARMED"], RESET: ["DISARMED", "READY", "ARMED", "ACTIVE"], ARM: ["ARMED", "ACTIVE"] };
const BY_HAND = "in a terminal, or the amplifier's switch";

class Commands {
  /** `socket` and `phase` return the current connection, and the displayed phase of the rig. */
  constructor(socket, phase) {
    [this.socket, this.phase] = [socket, phase];
    this.stop = null; // an unanswered STOP: when its time is over, and whether this connection has sent it
    this.failed = null; // the failure on display: its word, and the phase of the rig at that time
    this.hiding = 0;
  }

  get connected() {
    return this.socket()?.readyState === WebSocket.OPEN;
  }

  /** Send a command; STOP waits for a connection. */
  order(word, token) {
    if (word === "STOP") {
      this.stop = { until_ms: performance.now() + STOP_MS, sent: false };
      document.getElementById("stop").classList.add("busy");
      this.show(this.connected ? "stop: sent, waiting for the rig; if the exciter still vibrates, cut its amplifier by hand" : `stop: no connection to the server; trying for ${STOP_MS / 1e3} s`);
      this.retry();
    } else if (this.connected) {
      this.socket().send(JSON.stringify({ word, token }));
      if (word !== "SCOPE") this.show(`${word.toLowerCase()}: sent, waiting for the rig`);
    } else this.notSent(word, "");
  }

  /** Send a waiting STOP if there is a connection; report it once its time is over. */
  retry() {
    if (!this.stop || this.stop.sent) return;
    if (this.connected) {
      this.socket().send(JSON.stringify({ word: "STOP", token: "" }));
      this.stop.sent = true;
    } else if (performance.now() > this.stop.until_ms) {
      this.ended();
      this.notSent("STOP", ` for ${STOP_MS / 1e3} s`);
    }
  }

  notSent(word, how_long) {
    this.show(`${word.toLowerCase()}: NOT SENT: no connection to the server${how_long}. Use \`stickslip ${word.toLowerCase()}\` ${BY_HAND}`, word);
  }

  disconnected() {
    if (this.stop) this.stop.sent = false; // the answer can no longer arrive
  }

  ended() {
    this.stop = null;
    document.getElementById("stop").classList.remove("busy");
  }

  /** Show the outcome of a command. */
  answered(answer) {
    if (answer.word === "STOP") this.ended();
    const lines = [...(answer.done ? [] : [`${answer.word.toLowerCase()}: NOT DONE`]), ...answer.lines];
    this.show(lines.join("\n"), answer.done ? "" : answer.word);
  }

  /** Hide a failure that the rig has answered: it is back, it has ended, or it is in the wanted state. */
  follow(now) {
    if (!this.failed) return;
    const back = now.phase !== this.failed.phase && ["live", "ended"].includes(now.phase);
    if (back || WANTED[this.failed.word]?.includes(now.guard_state)) this.hide();
  }

  /** Show a text with its time of day; `failed` is the word of a command that failed. */
  show(text, failed = "") {
    const place = document.getElementById("told");
    clearTimeout(this.hiding);
    this.failed = failed && { word: failed, phase: this.phase() };
    place.textContent = `${new Date().toLocaleTimeString([], { hour12: false })}  ${text}`;
    place.classList.toggle("bad", failed !== "");
    place.hidden = false;
    if (!failed && !this.stop) this.hiding = setTimeout(() => this.hide(), OLD_MS);
  }

  hide() {
    this.failed = null;
    document.getElementById("told").hidden = true;
  }
}
