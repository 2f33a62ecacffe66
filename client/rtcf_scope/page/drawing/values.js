// The numbers at the left of a plot, drawn again when the scale is another one.
import { tickTexts } from "./axes.js";
import { ink } from "./palette.js";

export const LEFT = 64, TOP = 8, FONT = "11px system-ui, sans-serif";

export class Values {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.canvas.className = "values";
    this.g = this.canvas.getContext("2d", { alpha: false });
    this.state = "";
  }

  show(sight, units) {
    const { ratio } = sight, height = Math.ceil(sight.height / ratio) + TOP + 8;
    const state = `${sight.low} ${sight.high} ${height} ${ratio} ${document.documentElement.dataset.theme} ${units}`;
    if (state === this.state) return;
    this.state = state;
    this.canvas.width = LEFT * ratio;
    this.canvas.height = height * ratio;
    this.canvas.style.height = `${height}px`;
    this.g.scale(ratio, ratio);
    this.g.fillStyle = ink("paper");
    this.g.fillRect(0, 0, LEFT, height);
    drawValues(this.g, sight, units);
  }
}

export function drawValues(g, sight, units) {
  const { rows, ratio } = sight, height = sight.height / ratio;
  const { texts, note } = tickTexts(rows.at, rows.step);
  g.font = FONT;
  g.fillStyle = ink("soft");
  g.textAlign = "right";
  rows.at.forEach((value, i) => {
    const y = Math.min(Math.max(TOP + sight.y(value) + 4, TOP + 8), TOP + height);
    if (!note || y > TOP + 20) g.fillText(texts[i], LEFT - 6, y);
  });
  g.textAlign = "left";
  if (note) { g.fillStyle = ink("text"); g.fillText(note, 3, TOP + 8, LEFT - 6); g.fillStyle = ink("soft"); }
  g.save();
  g.translate(11, TOP + height / 2);
  g.rotate(-Math.PI / 2);
  g.textAlign = "center";
  g.fillText(units, 0, 0, height - 30);
  g.restore();
}
