// Vertical lines that move with time: events, the hit of a trigger, and cursors. Each has a label that
// ends before the next label begins.
const ROOM = 26; // CSS pixels that a label needs

export class Marks {
  constructor(strip) {
    this.strip = strip;
    this.box = document.createElement("div");
    strip.box.append(this.box);
    this.state = "";
  }

  // `marks`: {time, ink, label, title}, in order of time; `number` differs for different marks.
  show(sight, marks, number, labels) {
    const part = Math.floor(sight.first / sight.width);
    const state = `${this.strip.number} ${number} ${part} ${labels}`;
    if (state === this.state) return;
    this.state = state;
    const begin = (part - 1) * sight.width, end = (part + 3) * sight.width;
    const near = marks.map((mark) => ({ ...mark, column: Math.floor(sight.column(mark.time)) }))
      .filter(({ column }) => column >= begin && column <= end);
    this.box.replaceChildren(...near.map((mark, i) => this.#line(mark, sight, labels, near[i + 1]?.column ?? Infinity)));
  }

  #line({ column, ink, label, title }, { ratio }, labels, next) {
    const line = document.createElement("div");
    line.className = `mark ${ink}`;
    line.style.left = this.strip.left(column);
    const room = (next - column) / ratio;
    if (!labels || !label || room < ROOM) return line;
    const text = document.createElement("span");
    text.textContent = label;
    text.title = title ?? "";
    if (isFinite(room)) text.style.maxWidth = `${room - 2}px`;
    line.append(text);
    return line;
  }
}

// Draws a mark on the canvas of an export; `area` is that of the plot.
export function drawMark(g, area, place, colour, paper, label) {
  if (place < 0 || place > area.width) return;
  g.fillStyle = colour;
  g.fillRect(area.left + Math.floor(place), area.top, 1, area.height);
  if (!label) return;
  const width = g.measureText(label).width;
  const left = area.left + (place + width + 8 > area.width ? place - width - 5 : place + 4);
  g.fillStyle = paper;
  g.globalAlpha = 0.8;
  g.fillRect(left - 2, area.top + 2, width + 4, 13);
  g.globalAlpha = 1;
  g.fillStyle = colour;
  g.fillText(label, left, area.top + 12);
}
