// Draws columns of a plot: ground, grid, missing cycles and pauses of the loop, then the traces over each other.
import { colour, ink, pixel, symbol } from "./palette.js";
import { Slices } from "./slices.js";
import { drawTrace, reach } from "./trace.js";

const GAP = 0.28, PAUSE = 0.6; // opacity of missing cycles, and of a pause of the loop, over the background
const SHIFT = 53; // pixels between the symbols of one trace and the next

// Draws the columns [from, to) of a raster whose first column is column `base` of the sight.
// `traces`: {name, number, sight, track}, where `track` has the first and the last row, or is null.
export function drawColumns(raster, sight, base, from, to, sources, traces) {
  const paper = pixel(ink("paper")), grid = pixel(ink("grid")), bad = pixel(ink("bad"));
  raster.clear(from, to, paper);
  raster.clip(0, raster.height);
  for (const row of sight.grid) raster.row(row, from, to, grid);
  for (const { time } of sight.ticks(base + from - 1, base + to)) {
    const x = Math.round(sight.column(time)) - base;
    if (x >= from && x < to) raster.bar(x, 0, raster.height, grid);
  }
  sources.forEach((store, second) => {
    if (store.empty) return;
    raster.clip(0, raster.height);
    for (const gap of store.gaps) {
      const begin = Math.floor(sight.column(gap.from + store.shift)) - base;
      const end = Math.max(Math.ceil(sight.column(gap.to + store.shift)) - base, begin + 1);
      const [shade, opacity] = gap.cycles ? [bad, GAP] : [grid, PAUSE];
      for (let x = Math.max(begin, from); x < Math.min(end, to); x++) raster.bar(x, 0, raster.height, shade, opacity);
    }
    const slices = new Slices(store, sight.seconds, base, from, to, reachOf(sight, traces));
    traces.forEach((trace, order) => {
      const { name, number, track } = trace, column = store.column(name);
      if (!column) return;
      raster.clip(track ? track.first : 0, track ? track.last : sight.bottom);
      drawTrace(raster, slices, column, trace.sight, { colour: pixel(colour(number)), paper, symbol: symbol(number),
        shift: Math.round(number * SHIFT * sight.ratio), order: track ? 0 : order, second: second > 0, isTrack: track !== null });
    });
  });
}

// The state of the columns of a sight, while cycles arrive and the oldest ones are removed: columns
// before `gone` are empty, those before `held` are losing cycles, those from `final` on may still
// change, and those from `drawn` on have no cycles yet.
export function changesOf(sight, sources, traces) {
  const near = reachOf(sight, traces) + 1;
  const changes = { stamp: 0, final: Infinity, drawn: -Infinity, held: -Infinity, gone: -Infinity };
  for (const store of sources) {
    changes.stamp += store.end;
    if (store.end - store.begin < 2) { changes.final = -Infinity; changes.drawn = Infinity; continue; }
    // The shape of the line to the last cycle depends on the next one.
    changes.final = Math.min(changes.final, Math.floor(sight.column(store.time(store.end - 2))) - near);
    changes.drawn = Math.max(changes.drawn, Math.ceil(sight.column(store.lastTime)) + near);
    if (store.begin === 0) continue;
    const oldest = sight.column(store.firstTime);
    changes.held = Math.max(changes.held, Math.ceil(oldest) + near);
    changes.gone = Math.max(changes.gone, Math.floor(oldest) - near);
  }
  return changes;
}

function reachOf({ ratio }, traces) { return reach(ratio, traces.some(({ number }) => symbol(number))); }
