// The server: requests by HTTP, and the stream by a WebSocket that reconnects. Both authenticate by the
// session, which pages of this host and port share.
import { decode } from "./data/wire.js";

const AGAIN_MS = 1000;
const KEPT = "session";
const PROTOCOL = "rtcf-scope";
let own = ""; // session of this page, if localStorage is not available

function session() {
  try { return localStorage.getItem(KEPT) ?? own; } catch { return own; }
}

// Waits for the session that enter.js requests with the token of the address.
export async function enter() {
  const response = await window.entering?.catch(() => null);
  delete window.entering;
  if (!response?.ok) return;
  own = (await response.json()).session;
  try { localStorage.setItem(KEPT, own); } catch { /* only this page has the session */ }
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
  try { ({ refused } = JSON.parse(text)); } catch { /* it is not JSON but one line of text */ }
  throw Object.assign(new Error(refused ?? text.trim()), { status: response.status });
}

export async function ask(path, options = {}) {
  const response = await request(path, options);
  return (response.headers.get("Content-Type") ?? "").includes("json") ? response.json() : response.text();
}

export const query = (words) => new URLSearchParams(words).toString();

export async function recorded(name, traces, begin, end) { // times in s after its first cycle; all cycles without them
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

  // Sends a request, and repeats it after each reconnection.
  want(words) {
    Object.assign(this.wanted, words);
    this.#say(words);
  }

  close() { this.ended = true; this.socket.close(); }

  #say(words) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(words));
  }

  // Returns the reason why there is no stream, one line.
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
