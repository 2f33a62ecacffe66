// The drawing of the graph: components from writers to readers, in rows that turn at the end of the
// panel, coloured by their durations. Hovering over a port shows its value.
import { scaled } from "../drawing/axes.js";
import { left, place, route, top } from "./graph_layout.js";

const SIZES = { wide: 150, high: 40, gapX: 46, gapY: 24, laneX: 5, laneY: 4, port: 6 };
const ROUND = 5, LETTERS = 20, SHORTEST_MARKED = 16;
const FEWEST_COLUMNS = 3;
const NS = "http://www.w3.org/2000/svg";

export class Graph {
  constructor(box, values) { // values(component): a promise of the values of its ports
    this.box = box;
    this.values = values;
    this.graph = { components: [], connections: [] };
    this.statistics = null;
    this.columns = 0; // columns of the drawing; 0 = no drawing
    this.nodes = new Map();
    this.says = document.createElement("p");
    this.says.className = "says";
    new ResizeObserver(() => { if (this.#room() !== this.columns) this.#draw(); }).observe(box);
  }

  show({ components, connections }) {
    this.graph = { components, connections };
    this.#draw();
  }

  // Number of columns that fit; 0 for a hidden panel.
  #room() {
    const { clientWidth } = this.box;
    if (!clientWidth) return 0;
    return Math.max(Math.floor((clientWidth - SIZES.gapX) / (SIZES.wide + SIZES.gapX)), FEWEST_COLUMNS);
  }

  #draw() {
    this.columns = this.#room();
    if (!this.columns) return;
    const components = [...this.graph.components].sort((a, b) => a.position - b.position);
    const links = this.#links(components);
    const cells = place(components.map((each) => each.name), links, this.columns);
    const ends = [...cells.values()];
    const wide = left(Math.max(...ends.map((each) => each.column), 0) + 1, SIZES);
    const high = top(Math.max(...ends.map((each) => each.row), 0) + 1, SIZES);
    const svg = element("svg", { viewBox: `0 0 ${wide} ${high}`, width: wide, height: high });
    svg.append(arrow("arrow", "head"), arrow("arrow-back", "head back"));
    route(cells, links, SIZES).forEach((way, at) => svg.append(...this.#line(links[at], way)));
    this.nodes.clear();
    for (const each of components) svg.append(this.#node(each, cells.get(each.name)));
    const breaks = links.some((each) => each.broken) ? " Dashed, 1/z: a loop break, the value of the cycle before." : "";
    this.says.textContent = components.length ? `Point at a component or a connection.${breaks}` : "The graph is empty.";
    this.box.replaceChildren(this.says, ...(components.length ? [svg] : []));
    if (this.statistics) this.showStatistics(this.statistics);
  }

  #links(components) {
    const known = new Set(components.map((each) => each.name));
    // An input without a writer has no line.
    return this.graph.connections.filter((each) => each.writer || each.subscribed).flatMap((connection) => connection.readers
      .filter(([reader]) => known.has(reader))
      .map(([reader, port, broken]) => ({
        net: connection.name, writer: known.has(connection.writer?.[0]) ? connection.writer[0] : null, reader, broken, port, connection,
      })));
  }

  // Colours each component by its share of a cycle.
  showStatistics(statistics) {
    this.statistics = statistics;
    const most = Math.max(...Object.values(statistics.components).map((each) => each.mean), 1e-9);
    for (const [name, { mean, overruns }] of Object.entries(statistics.components)) {
      const node = this.nodes.get(name);
      if (!node) continue;
      node.rect.style.fillOpacity = 0.08 + 0.5 * mean / most;
      node.cost.textContent = scaled(mean / 1e6, "s") + (overruns ? `, ${overruns} late` : "");
    }
  }

  #node({ name, type, state, fault, doc, position }, { column, row }) {
    const moved = `translate(${left(column, SIZES)},${top(row, SIZES)})`;
    const group = element("g", { class: `node ${state}`, transform: moved, tabindex: 0, "data-component": name });
    const rect = element("rect", { width: SIZES.wide, height: SIZES.high, rx: 6 });
    const number = element("text", { x: SIZES.wide - 7, y: 32, class: "number" });
    number.textContent = position + 1;
    const label = element("text", { x: 8, y: 17, class: "name" });
    label.textContent = name.length > LETTERS ? `…${name.slice(1 - LETTERS)}` : name;
    const cost = element("text", { x: 8, y: 32, class: "cost" });
    group.append(rect, label, cost, number);
    this.nodes.set(name, { rect, cost });
    group.onpointerenter = group.onfocus = async () => {
      this.says.textContent = `${name} (${type}): ${fault || doc}`;
      const values = await this.values(name);
      const texts = Object.entries(values).map(([port, value]) => `${port} = ${value.replace(/^data: /, "").replace(/\s+/g, " ").slice(0, 60)}`);
      this.says.textContent = `${name} (${type})${fault ? `: ${fault}` : ""}   ${texts.join("   ")}`;
    };
    return group;
  }

  // A line, and its mark if it is a loop break.
  #line({ connection: { name, type, writer }, reader, port, broken }, way) {
    const path = element("path", {
      d: rounded(way), class: `edge${broken ? " broken" : ""}${writer ? "" : " outside"}`,
      "marker-end": `url(#${broken ? "arrow-back" : "arrow"})`,
      "data-from": writer ? writer[0] : "", "data-to": reader,
    });
    path.onpointerenter = async () => {
      const ends = `${writer ? writer.join(".") : "from outside"} → ${reader}.${port}${broken ? " (loop break: the value of the cycle before)" : ""}`;
      this.says.textContent = `${name}: ${ends}, ${type}`;
      const [component, at] = writer ?? [reader, port];
      const value = (await this.values(component))[at];
      if (value !== undefined) this.says.textContent += ` = ${value.replace(/^data: /, "").replace(/\s+/g, " ").slice(0, 120)}`;
    };
    if (!broken) return [path];
    const mark = element("g", { class: "break", transform: `translate(${markAt(way).join()})` });
    const ground = element("rect", { x: -11, y: -8, width: 22, height: 16, rx: 4 }), text = element("text", { y: 4 });
    text.textContent = "1/z";
    mark.append(ground, text);
    return [path, mark];
  }
}

// A line along rounded corners.
function rounded(way) {
  let d = `M${way[0].join()}`;
  for (let at = 1; at + 1 < way.length; at++) {
    const [before, here, after] = way.slice(at - 1, at + 2);
    d += ` L${towards(here, before).join()} Q${here.join()} ${towards(here, after).join()}`;
  }
  return `${d} L${way.at(-1).join()}`;
}

// The begin or end of a corner's rounding.
function towards(from, to) {
  const dx = to[0] - from[0], dy = to[1] - from[1], length = Math.hypot(dx, dy);
  const share = length ? Math.min(ROUND, length / 2) / length : 0;
  return [from[0] + dx * share, from[1] + dy * share];
}

// The middle of the last section of a line, or of its longest section.
function markAt(way) {
  const stretches = way.slice(1).map((b, at) => { const a = way[at]; return { a, b, length: Math.hypot(b[0] - a[0], b[1] - a[1]) }; });
  const last = stretches.at(-2);
  const { a, b } = last?.length >= SHORTEST_MARKED ? last : stretches.reduce((most, each) => (each.length > most.length ? each : most));
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
}

function element(name, attributes) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function arrow(id, style) {
  const defs = element("defs", {});
  const marker = element("marker", { id, viewBox: "0 0 8 8", refX: 8, refY: 4, markerWidth: 7, markerHeight: 7, markerUnits: "userSpaceOnUse", orient: "auto" });
  marker.append(element("path", { d: "M0,0 L8,4 L0,8 z", class: style }));
  defs.append(marker);
  return defs;
}
