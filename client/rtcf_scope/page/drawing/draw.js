// Draws one trace: a line through its values, or from minimum to maximum where a pixel has many.
import { ink } from "./palette.js";

const FEW = 2; // cycles a pixel, up to which each is drawn
const DOTS = 6; // pixels a cycle, from which each has a dot

export function drawTrace(g, store, column, view, area, y, stroke) {
  const first = Math.max(store.find(view.begin) - 1, store.begin);
  const last = Math.min(store.find(view.end) + 1, store.end);
  if (last - first < 1) return;
  const x = (time) => area.left + (time - view.begin) / view.span * area.width;
  g.strokeStyle = g.fillStyle = stroke.colour;
  g.lineWidth = stroke.width;
  g.setLineDash(stroke.dash);
  g.globalAlpha = stroke.alpha;
  g.beginPath();
  if ((last - first) / area.width > FEW) lows(g, store, column, view, area, y, x);
  else line(g, store, column, first, last, y, x);
  g.stroke();
  g.setLineDash([]);
  if (area.width / (last - first) >= DOTS) dots(g, store, column, first, last, y, x);
  g.globalAlpha = 1;
}

function line(g, store, column, first, last, y, x) {
  let pen = false;
  for (let at = first; at < last; at++) {
    const value = column.get(at);
    if (!isFinite(value)) { pen = false; continue; }
    if (pen) g.lineTo(x(store.time(at)), y(value)); else g.moveTo(x(store.time(at)), y(value));
    pen = true;
  }
}

// Pixels stand on a grid of time that does not move with the view: a spike does not flicker.
function lows(g, store, column, view, area, y, x) {
  const width = view.span / area.width;
  let pen = false;
  let at = store.find(Math.floor(view.begin / width) * width);
  for (let n = Math.floor(view.begin / width); n <= view.end / width; n++) {
    const until = store.find((n + 1) * width);
    if (until > at) {
      const [low, high] = column.range(at, until);
      if (low <= high) {
        const place = x((n + 0.5) * width);
        const enter = column.get(at);
        const from = isFinite(enter) && Math.abs(enter - low) < Math.abs(enter - high) ? low : high;
        if (pen) g.lineTo(place, y(from)); else g.moveTo(place, y(from));
        g.lineTo(place, y(from === low ? high : low) + (low === high ? 0.01 : 0));
        const leave = column.get(until - 1);
        if (isFinite(leave)) g.lineTo(place, y(leave));
        pen = true;
      } else pen = false;
    }
    at = until;
  }
}

function dots(g, store, column, first, last, y, x) {
  for (let at = first; at < last; at++) {
    const value = column.get(at);
    if (!isFinite(value)) continue;
    g.beginPath();
    g.arc(x(store.time(at)), y(value), 2.2, 0, 7);
    g.fill();
  }
}

// A vertical line with a word at its top.
export function drawMark(g, area, place, colour, text, dashed) {
  if (place < area.left || place > area.left + area.width) return;
  g.strokeStyle = g.fillStyle = colour;
  g.lineWidth = 1;
  g.setLineDash(dashed ? [3, 3] : []);
  g.beginPath();
  g.moveTo(Math.round(place) + 0.5, area.top);
  g.lineTo(Math.round(place) + 0.5, area.top + area.height);
  g.stroke();
  g.setLineDash([]);
  if (!text) return;
  const width = g.measureText(text).width;
  const left = place + width + 8 > area.left + area.width ? place - width - 5 : place + 4;
  g.fillStyle = ink("paper");
  g.globalAlpha = 0.75;
  g.fillRect(left - 2, area.top + 2, width + 4, 13);
  g.globalAlpha = 1;
  g.fillStyle = colour;
  g.fillText(text, left, area.top + 12);
}
