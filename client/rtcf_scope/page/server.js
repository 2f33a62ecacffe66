// The server: questions by HTTP, the stream by a WebSocket that comes back by itself.
import { decode } from "./data/wire.js";

const AGAIN_MS = 1000;

export async function ask(path, options = {}) {
  const response = await fetch(path, options);
  const type = response.headers.get("Content-Type") ?? "";
  const told = type.includes("json") ? await response.json() : await response.text();
  if (!response.ok) throw new Error(told.refused ?? told);
  return told;
}

export const query = (words) => new URLSearchParams(words).toString();

export async function recorded(name, traces, begin, end) { // s after its first cycle; all without
  const words = new URLSearchParams(traces.map((each) => ["trace", each]));
  if (begin !== undefined) { words.set("begin", begin); words.set("end", end); }
  const response = await fetch(`/api/recordings/${encodeURIComponent(name)}/columns?${words}`);
  if (!response.ok) throw new Error((await response.json()).refused);
  return decode(await response.arrayBuffer());
}

export class Stream {
  constructor(runner, heard) { // heard: message(text message), cycles(binary), connected(bool)
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

  #open() {
    this.socket = new WebSocket(`ws${location.protocol === "https:" ? "s" : ""}://${location.host}/stream?${query({ runner: this.runner })}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.heard.connected(true); this.#say(this.wanted); };
    this.socket.onclose = () => {
      if (this.ended) return;
      this.heard.connected(false);
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
