// Reads the binary messages of the server; ../wire.py writes them.
export const CYCLES = 1, SHOT = 2, RECORDED = 3;
const HEAD = 40, FIXED = 4;

// Columns are views of the message: nothing is copied.
export function decode(buffer) {
  const head = new DataView(buffer, 0, HEAD);
  const count = head.getUint32(4, true), width = head.getUint32(8, true);
  const column = (number) => new Float64Array(buffer, HEAD + 8 * count * number, count);
  return {
    kind: head.getUint8(0), last: head.getUint8(1) !== 0, watching: head.getUint16(2, true),
    count, lost: head.getFloat64(16, true), hit: head.getFloat64(24, true),
    times: column(0), cycles: column(1), latencies: column(2), durations: column(3),
    traces: Array.from({ length: width - FIXED }, (_, i) => column(i + FIXED)),
  };
}
