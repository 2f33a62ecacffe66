// An element that moves with time: it is shifted as a whole, by whole pixels of the screen, so that its
// content is drawn once.
const FAR = 1 << 20; // longest shift, pixels

export class Strip {
  constructor(name) {
    this.box = document.createElement("div");
    this.box.className = `strip ${name}`;
    this.origin = NaN; // column at the left end
    this.seconds = NaN;
    this.number = 0; // changes when the content must be placed again
    this.shift = null;
  }

  move(sight) {
    const { first, ratio, seconds } = sight;
    if (seconds !== this.seconds || ratio !== this.ratio || !(Math.abs(first - this.origin) < FAR)) {
      this.seconds = seconds;
      this.ratio = ratio;
      this.origin = first;
      this.number++;
    }
    const shift = `translateX(${(this.origin - first) / ratio}px)`;
    if (shift !== this.shift) this.box.style.transform = this.shift = shift;
  }

  // The CSS position of a column.
  left(column) { return `${(column - this.origin) / this.ratio}px`; }
}
