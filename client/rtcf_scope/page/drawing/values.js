// The numbers at the left or right of a plot, drawn again when the scale changes.
import { tickTexts } from "./axes.js";
import { ink } from "./palette.js";

export const LEFT = 64, TOP = 8, FONT = "11px system-ui, sans-serif";

export class Values {
  constructor(side) { // "left" or "right"
    this.side = side;
    this.canvas = document.createElement("canvas");
    this.canvas.className = `values ${side}`;
    this.g = this.canvas.getContext("2d", { alpha: false });
    this.state = "";
  }

  // `sight` is null if the scale has no traces; `colour` is the colour of the numbers.
  show(sight, whole, units, colour = ink("soft")) {
    const { ratio } = whole, height = Math.ceil(whole.height / ratio) + TOP + 8;
    const state = `${sight && [sight.low, sight.high, sight.bottom]} ${height} ${ratio} ${document.documentElement.dataset.theme} ${units} ${colour}`;
    if (state === this.state) return;
    this.state = state;
    this.canvas.width = LEFT * ratio;
    this.canvas.height = height * ratio;
    this.canvas.style.height = `${height}px`;
    this.g.scale(ratio, ratio);
    this.g.fillStyle = ink("paper");
    this.g.fillRect(0, 0, LEFT, height);
    if (sight) drawValues(this.g, sight, units, this.side, colour);
  }
}

// Draws them into the 64 pixels beside a plot.
export function drawValues(g, sight, units, side = "left", colour = ink("soft")) {
  const { rows, ratio } = sight, height = (sight.bottom - sight.top) / ratio, isLeft = side === "left";
  const { texts, note } = tickTexts(rows.at, rows.step);
  g.font = FONT;
  g.fillStyle = colour;
  g.textAlign = isLeft ? "right" : "left";
  rows.at.forEach((value, i) => {
    const y = Math.min(Math.max(TOP + sight.y(value) + 4, TOP + 8), TOP + height);
    if (!note || y > TOP + 20) g.fillText(texts[i], isLeft ? LEFT - 6 : 6, y);
    if (!isLeft) g.fillRect(0, TOP + Math.round(sight.y(value)), 4, 1);
  });
  g.textAlign = "left";
  if (note) { g.fillStyle = ink("text"); g.fillText(note, isLeft ? 3 : 6, TOP + 8, LEFT - 6); g.fillStyle = colour; }
  g.save();
  g.translate(isLeft ? 11 : LEFT - 6, TOP + height / 2);
  g.rotate(-Math.PI / 2);
  g.textAlign = "center";
  g.fillText(units, 0, 0, Math.max(height - 30, 10));
  g.restore();
  g.textAlign = "left";
}
