// The pixels of a part of a plot, drawn column by column. Columns are independent of each other, so
// that a growing plot has the same pixels as one drawn at once.
export class Raster {
  constructor(width, height) { // pixels of the screen
    this.width = width;
    this.height = height;
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    // Coverage of each pixel of the present column, until `settle`.
    this.cover = new Float32Array(height);
    this.top = height;
    this.bottom = 0;
    this.clip(0, height);
  }

  // Limits bars and coverage to the rows [begin, end).
  clip(begin, end) {
    this.begin = Math.max(begin, 0);
    this.end = Math.min(end, this.height);
  }

  // Fills the columns [from, to), in all rows or in one.
  clear(from, to, colour) {
    const { pixels, width } = this;
    for (let begin = from; begin < this.height * width; begin += width)
      for (let at = begin, end = begin + to - from; at < end; at++) pixels[at] = colour;
  }

  row(y, from, to, colour) {
    if (y >= 0 && y < this.height) this.pixels.fill(colour, y * this.width + from, y * this.width + to);
  }

  // Fills a part of a column between two rows, which need not be integers.
  bar(x, top, bottom, colour, alpha = 1) {
    top = Math.max(top, this.begin);
    bottom = Math.min(bottom, this.end);
    if (!(bottom > top)) return;
    const { pixels, width } = this;
    let first = Math.floor(top);
    const last = Math.floor(bottom);
    if (first === last) { this.mix(first * width + x, colour, (bottom - top) * alpha); return; }
    if (top > first) this.mix(first++ * width + x, colour, (first - top) * alpha);
    if (alpha === 1) for (let at = first * width + x, end = last * width + x; at < end; at += width) pixels[at] = colour;
    else for (let y = first; y < last; y++) this.mix(y * width + x, colour, alpha);
    if (bottom > last) this.mix(last * width + x, colour, (bottom - last) * alpha);
  }

  // Covers a part of a pixel of the present column: `share` of its area.
  add(y, share) {
    this.cover[y] += share;
    if (y < this.top) this.top = y;
    if (y >= this.bottom) this.bottom = y + 1;
  }

  // Colours the covered pixels of a column.
  settle(x, colour, alpha) {
    const { cover, width } = this;
    for (let y = this.top; y < this.bottom; y++) {
      if (cover[y] > 0) this.mix(y * width + x, colour, Math.min(cover[y], 1) * alpha);
      cover[y] = 0;
    }
    this.top = this.height;
    this.bottom = 0;
  }

  mix(at, colour, share) {
    if (share >= 1) { this.pixels[at] = colour; return; }
    const under = this.pixels[at], part = Math.round(share * 256);
    const red = under & 255, green = (under >> 8) & 255, blue = (under >> 16) & 255;
    this.pixels[at] = 0xff000000 | (red + ((((colour & 255) - red) * part) >> 8))
      | ((green + (((((colour >> 8) & 255) - green) * part) >> 8)) << 8)
      | ((blue + (((((colour >> 16) & 255) - blue) * part) >> 8)) << 16);
  }
}
