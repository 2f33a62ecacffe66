// Clears a canvas, and fits it to its size and to the pixels of the screen.
import { ink } from "./palette.js";

export function blank(canvas) {
  const g = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = width * ratio; canvas.height = height * ratio;
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = ink("paper");
  g.fillRect(0, 0, width, height);
  g.font = "11px system-ui, sans-serif";
  return { g, width, height };
}
