// Places of components on a grid, and routes of the lines between them. Values go from left to right; the
// direction turns at the end of each row, so that a long chain fits its panel.  Pure functions; `rtcfctl
// graph` does the same in Python (client/rtcfctl/graph/folding.py).
//
// A link is one reader of a connection: { net, writer (null = from outside), reader, broken }.  Lines of
// one net may overlap.

const ROWS = 8; // a layer of more components may have several columns
// Lines that run side by side, from the middle of a gap outwards.
const LANES_DOWN = [0, 1, -1, 2, -2, 3, -3], LANES_ACROSS = [0, 1, -1, 2, -2];

// Places by name: { column, row, turned: values go from right to left }.  `names` are in the order of the
// schedule; `columns` is their maximum number, at least 2.
export function place(names, links, columns) {
  const found = new Map();
  let column = 0, row = 0, below = 0;
  for (const island of islands(names, links)) {
    const cells = placeIsland(island, links, columns);
    const wide = 1 + Math.max(...[...cells.values()].map((each) => each.column));
    if (column + wide > columns) { column = 0; row = below; }
    for (const [name, cell] of cells) {
      found.set(name, { ...cell, column: column + cell.column, row: row + cell.row });
      below = Math.max(below, row + cell.row + 1);
    }
    column += wide;
  }
  return found;
}

// Splits the graph into groups without links between them; single components are last.
function islands(names, links) {
  const group = new Map(names.map((name) => [name, [name]]));
  for (const { writer, reader } of links) {
    if (writer === null || group.get(writer) === group.get(reader)) continue;
    const [less, more] = [group.get(writer), group.get(reader)].sort((a, b) => a.length - b.length);
    for (const name of less) { more.push(name); group.set(name, more); }
  }
  const at = new Map(names.map((name, number) => [name, number]));
  const found = [...new Set(group.values())].map((each) => each.sort((a, b) => at.get(a) - at.get(b)));
  return found.sort((a, b) => (a.length === 1) - (b.length === 1) || at.get(a[0]) - at.get(b[0]));
}

// Returns the layer of each component: the length of the longest path to it without loop breaks.
function layersOf(names, links) {
  const sources = new Map(names.map((name) => [name, []])), readers = new Map(names.map((name) => [name, []]));
  for (const { writer, reader, broken } of links) {
    if (broken || writer === reader || !sources.has(writer) || !sources.has(reader)) continue;
    sources.get(reader).push(writer);
    readers.get(writer).push(reader);
  }
  const found = new Map();
  for (const name of names) found.set(name, 1 + Math.max(-1, ...sources.get(name).map((each) => found.get(each) ?? -1)));
  // A component without writers is placed before its first reader.
  for (const name of names)
    if (!sources.get(name).length && readers.get(name).length)
      found.set(name, Math.max(0, Math.min(...readers.get(name).map((each) => found.get(each))) - 1));
  return found;
}

function placeIsland(names, links, columns) {
  const inside = new Set(names), layers = [];
  const own = links.filter((each) => inside.has(each.reader) && inside.has(each.writer));
  for (const [name, number] of layersOf(names, own)) (layers[number] ??= []).push(name);
  const most = Math.max(...layers.map((each) => each?.length ?? 0));
  const mostRows = Math.max(ROWS, Math.ceil(most / Math.max(columns - 1, 1)));
  const sources = new Map(names.map((name) => [name, []]));
  for (const { writer, reader, broken } of own) if (!broken) sources.get(reader).push(writer);
  const rows = new Map(), blocks = []; // columns of each layer
  for (const layer of layers.filter(Boolean)) {
    const wanted = new Map(layer.map((name) => [name, mean(sources.get(name).filter((each) => rows.has(each)).map((each) => rows.get(each)))]));
    const order = [...layer].sort((a, b) => wanted.get(a) - wanted.get(b)), block = [];
    for (let begin = 0; begin < order.length; begin += mostRows) {
      const column = order.slice(begin, begin + mostRows);
      placeRows(column, wanted, mostRows, rows);
      block.push(column);
    }
    blocks.push(block);
  }
  const bands = bandsOf(blocks, columns), cells = new Map();
  const wide = Math.max(...bands.map((each) => each.length));
  let top = 0;
  bands.forEach((band, number) => {
    const used = band.flat().map((name) => rows.get(name)), first = Math.min(...used), turned = number % 2 === 1;
    band.forEach((column, at) => {
      for (const name of column) cells.set(name, { column: turned ? wide - 1 - at : at, row: top + rows.get(name) - first, turned });
    });
    top += Math.max(...used) - first + 1;
  });
  return cells;
}

// Chooses a row for each component of a column, next to its writers if that row is free.
function placeRows(column, wanted, most, rows) {
  const found = [];
  for (const name of column) found.push(Math.max(Math.round(wanted.get(name)), found.length ? found.at(-1) + 1 : 0));
  let last = Math.max(most, column.length) - 1;
  for (let at = found.length - 1; at >= 0; at--) {
    found[at] = Math.min(found[at], last);
    last = found[at] - 1;
    rows.set(column[at], found[at]);
  }
}

// Cuts the layers into bands of similar length, each of at most `columns` columns.
function bandsOf(blocks, columns) {
  const total = blocks.reduce((sum, each) => sum + each.length, 0);
  const room = Math.ceil(total / Math.ceil(total / columns)), bands = [[]];
  for (const block of blocks) {
    if (bands.at(-1).length && bands.at(-1).length + block.length > Math.max(room, block.length)) bands.push([]);
    bands.at(-1).push(...block);
  }
  return bands;
}

const mean = (numbers) => (numbers.length ? numbers.reduce((a, b) => a + b, 0) / numbers.length : 0);

// The lines in gaps: lines of different nets do not overlap if there is room.
class Lanes {
  constructor(numbers) {
    this.numbers = numbers;
    this.used = new Map();
    this.nets = new Map();
  }

  take(gap, from, to, net) {
    const begin = Math.min(from, to), end = Math.max(from, to);
    const of = (lane) => this.used.get(`${gap} ${lane}`) ?? [];
    let lane = this.numbers.find((each) => of(each).every((line) => line.end < begin || end < line.begin || line.net === net));
    if (lane === undefined) {
      if (!this.nets.has(net)) this.nets.set(net, this.nets.size);
      lane = this.numbers[this.nets.get(net) % this.numbers.length];
    }
    this.used.set(`${gap} ${lane}`, [...of(lane), { begin, end, net }]);
    return lane;
  }
}

// Returns the route of each link: corners [x, y], the reader's end last; no line crosses a box.  `sizes`:
// wide and high of boxes, gapX and gapY between them, laneX and laneY between lines in a gap, port
// between lines at a box.
export function route(cells, links, sizes) {
  const outs = ports(links.map(({ writer, net }) => [writer, net]), sizes);
  const ins = ports(links.map(({ reader, net }) => [reader, net]), sizes);
  const down = new Lanes(LANES_DOWN), across = new Lanes(LANES_ACROSS);
  const middle = (gap) => left(gap, sizes) - sizes.gapX / 2;
  return links.map(({ net, writer, reader, broken }) => {
    const to = cells.get(reader), gapTo = to.column + to.turned;
    const x2 = left(to.column, sizes) + (to.turned ? sizes.wide : 0);
    const y2 = top(to.row, sizes) + sizes.high / 2 + ins.get(reader).get(net);
    if (writer === null) return [[middle(gapTo), y2], [x2, y2]];
    const start = cells.get(writer), gap = start.column + !start.turned;
    const x1 = left(start.column, sizes) + (start.turned ? 0 : sizes.wide);
    const y1 = top(start.row, sizes) + sizes.high / 2 + outs.get(writer).get(net);
    if (gap === gapTo) {
      if (y1 === y2 && x1 !== x2) return [[x1, y1], [x2, y2]];
      const x = middle(gap) + sizes.laneX * down.take(gap, y1, y2, net);
      return [[x1, y1], [x, y1], [x, y2], [x2, y2]];
    }
    // Above the reader; below it if the line comes from a lower row, or is a loop break in the same row.
    const above = to.row > start.row || (to.row === start.row && !broken), aisle = to.row + !above;
    const lane = across.take(aisle, middle(gap), middle(gapTo), net);
    const y = top(aisle, sizes) - sizes.gapY / 2 + sizes.laneY * lane;
    const xa = middle(gap) + sizes.laneX * down.take(gap, y1, y, net);
    const xb = middle(gapTo) + sizes.laneX * down.take(gapTo, y, y2, net);
    return [[x1, y1], [xa, y1], [xa, y], [xb, y], [xb, y2], [x2, y2]];
  });
}

// The left end of a column's boxes.
export const left = (column, { wide, gapX }) => gapX + column * (wide + gapX);
export const top = (row, { high, gapY }) => gapY + row * (high + gapY);

// Returns the distance of each net's end from the middle of a box.
function ports(ends, { port, high }) {
  const nets = new Map();
  for (const [component, net] of ends) nets.set(component, (nets.get(component) ?? new Map()).set(net, 0));
  for (const own of nets.values()) {
    const step = Math.min(port, 0.7 * high / own.size);
    [...own.keys()].forEach((net, number) => own.set(net, (number - (own.size - 1) / 2) * step));
  }
  return nets;
}
