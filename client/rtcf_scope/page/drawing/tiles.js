// The traces of a plot as a row of canvases (tiles) that move with time. A tile is drawn once; in the
// tile with the newest cycles, only their columns are drawn.
import { Raster } from "./raster.js";
import { Strip } from "./strip.js";

export const WIDE = 512; // pixels of the screen; many canvases cost more than large ones

export class Tiles {
  constructor(box) {
    this.strip = new Strip("tiles");
    box.append(this.strip.box);
    this.tiles = [];
    this.key = "";
    this.raster = null;
  }

  // Draws all tiles again if `key` has changed. `changes` comes from changesOf() in columns.js; its
  // `stamp` increases with new cycles.
  show(sight, key, changes, draw) {
    this.strip.move(sight);
    if (key !== this.key) this.#begin(sight, key);
    const begin = Math.floor(sight.first / WIDE), end = Math.floor((sight.first + sight.width - 1) / WIDE);
    const others = this.tiles.filter((each) => !(each.number >= begin && each.number <= end));
    const there = new Map(this.tiles.map((each) => [each.number, each]));
    for (let number = begin; number <= end; number++) {
      const tile = there.get(number) ?? this.#take(others.pop(), number);
      if (tile.place !== this.strip.number) { tile.place = this.strip.number; tile.canvas.style.left = this.strip.left(number * WIDE); }
      this.#update(tile, changes, draw);
    }
    // Keep one spare tile for reuse, with an old image, out of sight.
    const [spare, ...more] = others;
    if (spare) spare.canvas.style.display = "none";
    for (const tile of more) {
      tile.canvas.remove();
      this.tiles.splice(this.tiles.indexOf(tile), 1);
    }
  }

  forget() { this.key = ""; }

  #begin(sight, key) {
    this.key = key;
    if (this.raster?.height !== sight.height) this.raster = new Raster(WIDE, sight.height);
    for (const tile of this.tiles) this.#size(tile, sight);
    this.sight = sight;
  }

  #take(tile, number) {
    if (!tile) {
      const canvas = document.createElement("canvas");
      tile = { canvas, g: canvas.getContext("2d", { alpha: false }) };
      this.#size(tile, this.sight);
      this.tiles.push(tile);
      this.strip.box.prepend(canvas);
    }
    tile.canvas.style.display = "";
    return Object.assign(tile, { number, place: NaN, ready: 0, stamp: NaN, old: false });
  }

  #size(tile, { height, ratio }) {
    const { canvas } = tile;
    if (canvas.width !== WIDE) canvas.width = WIDE;
    if (canvas.height !== height) canvas.height = height;
    canvas.style.width = `${WIDE / ratio}px`;
    canvas.style.height = `${height / ratio}px`;
    Object.assign(tile, { number: NaN, place: NaN });
  }

  #update(tile, { stamp, final, drawn, held, gone }, draw) {
    const base = tile.number * WIDE;
    let from = tile.ready, to = WIDE;
    if (base < held && !tile.old) from = 0; // some of its cycles were removed
    else if (from >= WIDE || tile.stamp === stamp) return;
    else if (!Number.isNaN(tile.stamp)) to = Math.min(to, drawn - base);
    tile.stamp = stamp;
    tile.ready = Math.min(Math.max(final - base, 0), WIDE);
    tile.old = base + WIDE <= gone;
    if (from >= to) return;
    draw(this.raster, base, from, to);
    tile.g.putImageData(this.raster.image, 0, 0, from, 0, to - from, this.raster.height);
  }
}
