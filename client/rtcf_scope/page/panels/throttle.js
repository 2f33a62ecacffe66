// Limits an expensive function to a tenth of the time: the longer it takes, the less often it runs.
const SHARE = 0.1;

export class Throttle {
  constructor() { this.next = 0; }

  run(does) {
    const begin = performance.now();
    if (begin < this.next) return;
    does();
    const end = performance.now();
    this.next = end + (end - begin) * (1 / SHARE - 1);
  }
}
