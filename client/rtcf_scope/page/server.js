// The server: questions by HTTP, the stream by a WebSocket that comes back by itself. Each shows the
// session, which pages of this host and port keep for each other.
import { decode } from "./data/wire.js";

const AGAIN_MS = 1000;
const KEPT = "session";
const PROTOCOL = "rtcf-scope";
let own = ""; // where nothing can be kept

function session() {
  try { return localStorage.getItem(KEPT) ?? own; } catch { return own; }
}

// Waits for the session that a token in the address gives.
export async function enter() {
  const response = await window.entering?.catch(() => null);
  delete window.entering;
  if (!response?.ok) return;
  own = (await response.json()).session;
  try { localStorage.setItem(KEPT, own); } catch { /* this page has it alone */ }
}

// Calls `does` when another page gets a session.
export function onSession(does) {
  window.addEventListener("storage", ({ key, newValue }) => { if (key === KEPT && newValue) does(); });
}

export async function request(path, options = {}) {
  const headers = { ...options.headers, Authorization: `Bearer ${session()}` };
  const response = await fetch(path, { ...options, headers }).catch(() => { throw new Error("no connection to the scope's server"); });
  if (response.ok) return response;
  const text = await response.text();
  let refused;
  try { ({ refused } = JSON.parse(text)); } catch { /* it is a line */ }
  throw Object.assign(new Error(refused ?? text.trim()), { status: response.status });
}

export async function ask(path, options = {}) {
  const response = await request(path, options);
  return (response.headers.get("Content-Type") ?? "").includes("json") ? response.json() : response.text();
}

export const query = (words) => new URLSearchParams(words).toString();

export async function recorded(name, traces, begin, end) { // s after its first cycle; all without
  const words = new URLSearchParams(traces.map((each) => ["trace", each]));
  if (begin !== undefined) { words.set("begin", begin); words.set("end", end); }
  const response = await request(`/api/recordings/${encodeURIComponent(name)}/columns?${words}`);
  return decode(await response.arrayBuffer());
}

export class Stream {
  constructor(runner, heard) { // heard: message(text message), cycles(binary), connected(bool, why not)
    this.runner = runner;
    this.heard = heard;
    this.watching = { number: -1, names: [] };
    this.wanted = {};
    this.ended = false;
    this.#open();
  }

  // Said again after each reconnection.
  want(words) {
    Object.assign(this.wanted, words);
    this.#say(words);
  }

  close() { this.ended = true; this.socket.close(); }

  #say(words) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(words));
  }

  // Why there is no stream, in a line.
  async #why() {
    try { await request(`/stream?${query({ runner: this.runner })}`); } catch (error) {
      if (error.status >= 403) return error.message;
    }
    return "no connection to the scope's server: it is tried again";
  }

  #open() {
    this.socket = new WebSocket(`ws${location.protocol === "https:" ? "s" : ""}://${location.host}/stream?${query({ runner: this.runner })}`,
      [PROTOCOL, `session.${session()}`]);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.heard.connected(true, ""); this.#say(this.wanted); };
    this.socket.onclose = async () => {
      if (this.ended) return;
      const why = await this.#why();
      if (this.ended) return;
      this.heard.connected(false, why);
      setTimeout(() => this.ended || this.#open(), AGAIN_MS);
    };
    this.socket.onmessage = ({ data }) => {
      if (this.ended) return;
      if (typeof data === "string") {
        const message = JSON.parse(data);
        if (message.kind === "watching") this.watching = message;
        this.heard.message(message);
      } else {
        const cycles = decode(data);
        if (cycles.watching === this.watching.number) this.heard.cycles(cycles, this.watching.names);
      }
    };
  }
}
