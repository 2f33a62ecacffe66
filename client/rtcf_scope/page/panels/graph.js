// The graph as a picture: components from left to right as values go, coloured by what they cost;
// a value stands at what is pointed at.
import { scaled } from "../drawing/axes.js";

const WIDE = 150, HIGH = 40, GAP_X = 70, GAP_Y = 18, PAD = 16;
const NS = "http://www.w3.org/2000/svg";

export class Graph {
  constructor(box, values) { // values(component): a promise of what its ports hold
    this.box = box;
    this.values = values;
    this.told = { components: [], connections: [] };
    this.nodes = new Map();
  }

  show({ components, connections }) {
    this.told = { components, connections };
    const place = layered(components, connections);
    const wide = Math.max(...[...place.values()].map((each) => each.x), 0) + WIDE + PAD * 2;
    const high = Math.max(...[...place.values()].map((each) => each.y), 0) + HIGH + PAD * 2 + 20;
    const svg = element("svg", { viewBox: `0 0 ${wide} ${high}`, width: wide, height: high });
    svg.append(arrow());
    for (const each of connections) this.#edges(svg, each, place);
    this.nodes.clear();
    for (const each of components) svg.append(this.#node(each, place.get(each.name)));
    this.says = document.createElement("p");
    this.says.className = "says";
    this.says.textContent = components.length ? "Point at a component or a connection." : "The graph is empty.";
    this.box.replaceChildren(this.says, svg);
  }

  // Colours by what each component takes of a cycle.
  tell(figures) {
    const most = Math.max(...Object.values(figures.components).map((each) => each.mean), 1e-9);
    for (const [name, { mean, overruns }] of Object.entries(figures.components)) {
      const node = this.nodes.get(name);
      if (!node) continue;
      node.rect.style.fillOpacity = 0.08 + 0.5 * mean / most;
      node.cost.textContent = scaled(mean / 1e6, "s") + (overruns ? `, ${overruns} late` : "");
    }
  }

  #node({ name, type, state, fault, doc }, { x, y }) {
    const group = element("g", { class: `node ${state}`, transform: `translate(${x + PAD},${y + PAD})`, tabindex: 0 });
    const rect = element("rect", { width: WIDE, height: HIGH, rx: 6 });
    const label = element("text", { x: 8, y: 17, class: "name" });
    label.textContent = name.length > 22 ? `…${name.slice(-21)}` : name;
    const cost = element("text", { x: 8, y: 32, class: "cost" });
    group.append(rect, label, cost);
    this.nodes.set(name, { rect, cost });
    group.onpointerenter = group.onfocus = async () => {
      this.says.textContent = `${name} (${type}): ${fault || doc}`;
      const values = await this.values(name);
      const texts = Object.entries(values).map(([port, value]) => `${port} = ${value.replace(/^data: /, "").replace(/\s+/g, " ").slice(0, 60)}`);
      this.says.textContent = `${name} (${type})${fault ? `: ${fault}` : ""}   ${texts.join("   ")}`;
    };
    return group;
  }

  #edges(svg, connection, place) {
    const { writer, readers, name, type } = connection;
    for (const [reader, port, broken] of readers) {
      const to = place.get(reader), from = writer ? place.get(writer[0]) : null;
      if (!to) continue;
      const x2 = to.x + PAD, y2 = to.y + PAD + HIGH / 2;
      const x1 = from ? from.x + PAD + WIDE : x2 - GAP_X + 24, y1 = from ? from.y + PAD + HIGH / 2 : y2;
      const back = x1 > x2;
      const bend = back ? 60 : Math.max((x2 - x1) / 2, 20), sink = back ? HIGH + 10 : 0;
      const path = element("path", {
        d: back ? `M${x1},${y1} C${x1 + bend},${y1 + sink * 1.4} ${x2 - bend},${y2 + sink * 1.4} ${x2},${y2}`
          : `M${x1},${y1} C${x1 + bend},${y1} ${x2 - bend},${y2} ${x2},${y2}`,
        class: `edge${broken ? " broken" : ""}${writer ? "" : " outside"}`, "marker-end": "url(#arrow)",
      });
      path.onpointerenter = async () => {
        const ends = `${writer ? writer.join(".") : "from outside"} → ${reader}.${port}${broken ? " (value of the previous cycle)" : ""}`;
        this.says.textContent = `${name}: ${ends}, ${type}`;
        const [component, at] = writer ?? [reader, port];
        const value = (await this.values(component))[at];
        if (value !== undefined) this.says.textContent += ` = ${value.replace(/^data: /, "").replace(/\s+/g, " ").slice(0, 120)}`;
      };
      svg.append(path);
    }
  }
}

// Columns by the longest way from a source, loop breaks not counted; rows by where values come from.
export function layered(components, connections) {
  const known = new Set(components.map((each) => each.name));
  const sources = new Map(components.map((each) => [each.name, []]));
  for (const { writer, readers } of connections)
    for (const [reader, , broken] of readers)
      if (writer && !broken && known.has(writer[0]) && known.has(reader) && writer[0] !== reader) sources.get(reader).push(writer[0]);
  const layers = new Map();
  const placed = [...components].sort((a, b) => a.position - b.position);
  for (const { name } of placed)
    layers.set(name, Math.max(-1, ...sources.get(name).map((each) => layers.get(each) ?? -1)) + 1);
  const rows = new Map(), used = new Map();
  for (const { name } of [...placed].sort((a, b) => layers.get(a.name) - layers.get(b.name))) {
    const layer = layers.get(name), above = sources.get(name).map((each) => rows.get(each)).filter((each) => each !== undefined);
    const taken = used.get(layer) ?? new Set();
    let row = above.length ? Math.round(above.reduce((a, b) => a + b, 0) / above.length) : 0;
    while (taken.has(row)) row++;
    taken.add(row);
    used.set(layer, taken);
    rows.set(name, row);
  }
  return new Map(placed.map(({ name }) => [name, { x: layers.get(name) * (WIDE + GAP_X), y: rows.get(name) * (HIGH + GAP_Y) }]));
}

function element(name, attributes) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function arrow() {
  const defs = element("defs", {});
  const marker = element("marker", { id: "arrow", viewBox: "0 0 8 8", refX: 8, refY: 4, markerWidth: 7, markerHeight: 7, orient: "auto" });
  marker.append(element("path", { d: "M0,0 L8,4 L0,8 z", class: "head" }));
  defs.append(marker);
  return defs;
}
