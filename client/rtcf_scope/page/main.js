// Assembles the page: the scope, its panels, the stream and the buttons.
import { scaled } from "./drawing/axes.js";
import * as exporting from "./export.js";
import { KEYS, bindKeys } from "./keys.js";
import * as layout from "./layout.js";
import { Cycles } from "./panels/cycles.js";
import { Derive } from "./panels/derive.js";
import { Events } from "./panels/events.js";
import { FaultBanner } from "./panels/fault.js";
import { Graph } from "./panels/graph.js";
import { Measurements } from "./panels/measurements.js";
import { Parameters } from "./panels/parameters.js";
import { Recordings } from "./panels/recordings.js";
import { Robot } from "./panels/robot.js";
import { Spectrum } from "./panels/spectrum.js";
import { Tree } from "./panels/tree.js";
import { TriggerPanel } from "./panels/trigger.js";
import { XY } from "./panels/xy.js";
import { sizesPart } from "./resize.js";
import { isForInformation, Scope } from "./scope.js";
import { Stream, ask, enter, onSession, query } from "./server.js";
import { sources } from "./data/derived.js";
import { DURATION, LATENCY } from "./data/store.js";

const SLOW_MS = 250; // between two updates of slow parts
const CYCLES = [{ name: LATENCY, unit: "µs", kind: "number" }, { name: DURATION, unit: "µs", kind: "number" }];
const $ = (id) => document.getElementById(id);
const drawerOf = (name) => document.querySelector(`.drawer[data-drawer=${name}]`);

const scope = new Scope($("panes"));
const page = { right: "observe", runner: () => $("runner").value, setError: (text) => setError("page", text) };
const tree = new Tree(scope, $("tree"), $("search"));
const parameters = new Parameters($("parameters"), page);
const recordings = new Recordings(scope, $("recordings"), page.setError);
const triggering = new TriggerPanel(scope, $("trigger"), arm);
const measurements = new Measurements(scope, drawerOf("measurements"));
const spectrum = new Spectrum(scope, $("spectrum"));
const xy = new XY(scope, drawerOf("xy"));
const cycles = new Cycles(scope, $("cycles"));
const events = new Events(scope, drawerOf("events"));
const graph = new Graph(drawerOf("graph"), async (name) => (await ask(`/api/component?${query({ runner: page.runner(), name })}`)).values);
const robot = new Robot(scope, $("robot"), page, {
  onPick: (signals) => { for (const name of signals) if (scope.units.has(name)) scope.active.add(name); scope.onTraces(); scope.changed(); },
  onSignals: () => watch(),
});
recordings.alsoNeeded = () => robot.signals;
const banner = new FaultBanner($("fault"), (name) => recordings.openIncident(name));
const counters = { frames: 0, perSecond: 0, since: performance.now(), state: {} };
new Derive(scope, $("derive"));
let stream = null, drawer = "measurements", generation = -1, liveCatalog = [];
const errors = new Map();
window.scope = scope; // for tests and the browser's tools
window.counters = counters;
window.robot = robot;

function setError(source, text) {
  if (text) errors.set(source, text); else errors.delete(source);
  $("error").hidden = !errors.size;
  $("error").textContent = [...errors.values()].join(" · ");
}

function arm(trigger) {
  if (trigger) scope.clearShots();
  stream?.want({ trigger });
}

// Watches the signals of the panes and the robot: one request for all changes at a time.
let watching = false;
function watch() {
  if (watching) return;
  watching = true;
  queueMicrotask(() => {
    watching = false;
    const names = [...new Set([...scope.traces().map((each) => each.name), ...robot.signals])];
    stream?.want({ watch: sources(names) });
    scope.live.keep(names);
  });
}

function triggerIs(words) {
  Object.assign(scope.trigger, words);
  triggering.showState();
}
const OFF = { state: "off", armed: [], missing: [] };

scope.onActive = () => tree.show();
scope.onTraces = () => {
  watch();
  tree.show();
  if (scope.mode === "trigger") triggering.show();
  if (scope.mode === "recording" && recordings.open.length) recordings.load().catch((error) => page.setError(error.message));
};

function connect(runner) {
  stream?.close();
  scope.live.clear();
  scope.clearShots();
  scope.events = [];
  generation = -1;
  liveCatalog = [];
  for (const source of ["rtcfd", "missing", "graph"]) setError(source, "");
  triggerIs(OFF);
  stream = new Stream(runner, {
    connected: (is, why) => {
      setError("connection", why);
      if (is) {
        for (const source of ["rtcfd", "missing"]) setError(source, "");
        generation = -1; // request the changes since then
      }
      // A trigger that waits is armed again after a reconnection.
      else if (scope.trigger.state !== "armed") stream.wanted.trigger = null;
    },
    message: receive,
    cycles: (message, names) => {
      if (message.kind === 2) { scope.addShot(message, names); triggering.showState(); }
      else scope.live.push(message, names);
    },
  });
  watch();
  catalog();
}

function receive(message) {
  if (message.kind === "error") setError("rtcfd", message.text);
  else if (message.kind === "missing") { setError("missing", message.text); triggerIs({ missing: message.trigger }); }
  else if (message.kind === "refused") page.setError(message.text);
  else if (message.kind === "watching") rebase(BigInt(message.base_ns));
  else if (message.kind === "trigger") triggerIs(message.state === "armed" ? { state: "armed", armed: message.signals } : { ...OFF, state: message.state });
  else if (message.kind === "state") state(message);
  else if (message.kind === "event" || message.kind === "record") {
    scope.events.push(message);
    // Informational events are removed first.
    if (scope.events.length > 1000) scope.events.splice(Math.max(0, scope.events.findIndex(isForInformation)), 1);
    if (message.what === "parameters") renew(false);
    if (drawer === "events") events.show();
    scope.changed();
  }
}

function rebase(baseNs) {
  if (baseNs !== scope.baseNs) scope.live.clear();
  scope.baseNs = baseNs;
}

function state(message) {
  counters.state = message;
  scope.rate = message.frequency_hz;
  $("state").textContent = message.frequency_hz ? `${message.state}, ${scaled(message.frequency_hz, "Hz")}` : message.state;
  $("state").className = message.state;
  banner.show(message);
  $("state").title = [message.status, ...(message.degraded ?? [])].filter(Boolean).join("\n");
  if (message.generation === undefined) { if (generation !== -1) runners().catch(() => {}); generation = -1; } // the runner was removed
  else if (message.generation !== generation) { generation = message.generation; renew(true); }
}

// Lists the existing runners and the shown one, which may not exist.
async function runners() {
  const about = await ask("/api/about");
  const names = about.runners.map(({ runner }) => runner);
  const shown = page.runner();
  const all = shown && !names.includes(shown) ? [...names, shown] : names;
  const options = all.map((name) => new Option(names.includes(name) ? name : `${name} (not there)`, name));
  // An open list is not replaced.
  if (options.map((each) => each.text).join() !== [...$("runner").options].map((each) => each.text).join()) {
    $("runner").replaceChildren(...options);
    if (shown) $("runner").value = shown;
  }
  return about;
}

// Requests the graph again: as a whole, or only the values of parameters.
async function renew(all) {
  const runner = page.runner();
  try {
    const found = await ask(`/api/graph?${query({ runner })}`);
    if (runner !== page.runner()) return;
    liveCatalog = found.signals;
    scope.know(found.signals);
    if (all) { catalog(); parameters.show(found.components); graph.show(found); watch(); await robot.load(); }
    else parameters.update(found.components);
    await parameters.who();
    setError("graph", "");
  } catch (error) { if (runner === page.runner()) setError("graph", error.message); }
}

function catalog() {
  scope.catalog = [...CYCLES, ...(scope.mode === "recording" ? recordings.catalog() : liveCatalog)];
  tree.show();
  if (scope.mode === "trigger") triggering.show();
}

function mode(name) {
  if (name !== "recording" && recordings.open.length) { recordings.open = []; recordings.show(); }
  scope.setMode(name);
  show();
}

function show() {
  $("roll").setAttribute("aria-pressed", String(scope.mode === "roll"));
  $("triggered").setAttribute("aria-pressed", String(scope.mode === "trigger"));
  $("trigger").hidden = scope.mode !== "trigger";
  catalog();
}

function open(name) {
  drawer = name;
  for (const each of document.querySelectorAll("[data-drawer]")) {
    if (each.matches("button")) each.setAttribute("aria-selected", String(each.dataset.drawer === name));
    else each.hidden = each.dataset.drawer !== name;
  }
  slow();
  scope.changed();
}

function showRobot(is, found) {
  $("robots").setAttribute("aria-pressed", String(is));
  $("between").hidden = !is;
  if (is) robot.open(found); else robot.close();
  scope.changed();
}

// Expensive updates: a few times a second, and only of visible parts.
async function slow() {
  const now = performance.now();
  if (now - counters.since > 1000) {
    counters.perSecond = counters.frames / (now - counters.since) * 1000;
    counters.frames = 0;
    counters.since = now;
    if (drawer === "cycles" || drawer === "graph") {
      try {
        cycles.statistics = await ask(`/api/statistics?${query({ runner: page.runner() })}`);
        graph.showStatistics(cycles.statistics);
        setError("statistics", "");
      } catch (error) { setError("statistics", error.message); }
    }
  }
  if (scope.mode === "recording") recordings.loadVisible();
  triggering.preview();
  for (const pane of scope.panes) pane.update();
  ({ measurements, spectrum, xy, cycles, events }[drawer] ?? { show() {} }).show();
  $("span").textContent = scaled(scope.view.span, "s");
  const frozen = scope.mode === "roll" && !scope.view.follows;
  $("freeze").textContent = frozen ? "Run" : "Freeze";
  $("freeze").classList.toggle("frozen", frozen);
  $("freeze").disabled = scope.mode !== "roll";
  const { overruns = 0 } = counters.state;
  const { lost } = scope.live;
  $("counters").textContent = [`${overruns} overrun${overruns === 1 ? "" : "s"}`, ...(lost ? [`${lost} cycles not seen here`] : []),
    `${Math.round(counters.perSecond)} frames/s`].join(" · ");
}

async function layouts() {
  const names = await layout.names();
  $("layouts").replaceChildren(new Option("Layouts…", ""), ...names.map((name) => new Option(name, `=${name}`)),
    new Option("Save as…", "save"), ...(names.length ? [new Option("Remove…", "remove")] : []));
}

async function chooseLayout(choice) {
  if (choice === "save") {
    const name = prompt("Save this layout as");
    if (name) await layout.save(name, layout.taken(scope, page.runner(), drawer, xy, robot));
  } else if (choice === "remove") {
    const name = prompt("Remove which layout?");
    if (name) await layout.remove(name);
  } else apply(await layout.read(choice.slice(1)));
  await layouts();
}

function apply(found) {
  if (typeof found?.runner === "string" && found.runner && found.runner !== page.runner()) {
    if (![...$("runner").options].some((each) => each.value === found.runner)) $("runner").append(new Option(`${found.runner} (not there)`, found.runner));
    $("runner").value = found.runner;
    connect(found.runner);
  } else arm(null); // the layout has another trigger
  xy.take(found?.xy ?? {});
  setError("layout", layout.given(scope, found ?? {}));
  mode(found?.mode === "trigger" ? "trigger" : "roll");
  if ((found?.robot === true) !== robot.isOpen) showRobot(found?.robot === true);
  if (["measurements", "spectrum", "xy", "cycles", "graph", "events"].includes(found?.drawer)) open(found.drawer);
}

const systemsLight = matchMedia("(prefers-color-scheme: light)");

// The chosen theme, or the system's.
function theme() {
  document.documentElement.dataset.theme = localStorage.getItem("theme") ?? (systemsLight.matches ? "light" : "dark");
  for (const pane of scope.panes) pane.describe();
  robot.themed();
  tree.show();
  scope.changed();
}

const trying = (does) => Promise.resolve().then(does).then(() => page.setError(""), (error) => page.setError(error.message));

function buttons() {
  const freeze = () => (scope.view.follows ? scope.freeze() : scope.run());
  const other = () => {
    localStorage.setItem("theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    theme();
  };
  $("roll").onclick = () => mode("roll");
  $("triggered").onclick = () => mode("trigger");
  $("freeze").onclick = freeze;
  $("shorter").onclick = () => { scope.view.step(-1); scope.changed(); };
  $("longer").onclick = () => { scope.view.step(1); scope.changed(); };
  $("pane").onclick = () => scope.addPane();
  const robots = () => showRobot(!robot.isOpen);
  $("robots").onclick = robots;
  $("theme").onclick = other;
  $("help").onclick = () => $("keys").showModal();
  $("runner").onchange = () => connect(page.runner());
  $("runner").onfocus = () => runners().catch(() => {}); // the stream reports the error
  $("trigger").onsubmit = (event) => event.preventDefault();
  $("layouts").onchange = ({ target }) => { const choice = target.value; target.value = ""; trying(() => chooseLayout(choice)); };
  $("export").onchange = ({ target }) => {
    const choice = target.value;
    target.value = "";
    trying(() => ({ png: exporting.toPng, csv: exporting.toCsv, mcap: exporting.toMcap, report: exporting.toReport })[choice](scope, page.runner()));
  };
  for (const each of document.querySelectorAll("footer [role=tab]")) each.onclick = () => open(each.dataset.drawer);
  for (const each of document.querySelectorAll("aside [role=tab]")) each.onclick = () => {
    for (const tab of document.querySelectorAll("aside [role=tab]")) tab.setAttribute("aria-selected", String(tab === each));
    for (const section of document.querySelectorAll("aside section")) section.hidden = section.dataset.tab !== each.dataset.tab;
  };
  $("keys").querySelector("dl").replaceChildren(...KEYS.flatMap(([key, does]) => [
    Object.assign(document.createElement("dt"), { textContent: key }), Object.assign(document.createElement("dd"), { textContent: does })]));
  const pointing = () => {
    scope.isPointing = !scope.isPointing;
    scope.pointAt(null);
  };
  sizesPart($("beside"), "--list", { axis: "x", sign: 1, size: () => $("list").offsetWidth, least: 140, most: () => innerWidth * 0.6 });
  sizesPart($("between"), "--robot", { axis: "x", sign: -1, size: () => $("robot").offsetWidth, least: 200, most: () => innerWidth * 0.8 });
  sizesPart($("above"), "--drawer", { axis: "y", sign: -1, size: () => drawerOf(drawer).offsetHeight, least: 60, most: () => innerHeight * 0.65 });
  bindKeys(scope, { freeze, pointing, robot: robots, theme: other, search: () => $("search").focus(), help: () => $("keys").showModal(),
    mode: () => mode(scope.mode === "trigger" ? "roll" : "trigger") });
}

function frame(now) {
  requestAnimationFrame(frame); // first, so that an error does not end the drawing
  const isDrawn = scope.frame(now);
  if (robot.frame() || isDrawn) counters.frames++;
}

async function begin() {
  theme();
  systemsLight.onchange = theme;
  buttons();
  const asked = layout.ofAddress();
  await enter();
  const about = await runners();
  page.right = about.right;
  connect(page.runner());
  if (asked) apply(asked);
  else {
    const found = await robot.request().catch(() => null);
    if (found?.links.length) showRobot(true, found);
    if (found?.layout) setError("layout", layout.given(scope, found.layout));
  }
  // Set last: before, the address has the requested layout.
  scope.onLayout = () => layout.toAddress(() => layout.taken(scope, page.runner(), drawer, xy, robot));
  await Promise.all([layouts(), recordings.show()]);
  new ResizeObserver(() => scope.changed()).observe($("panes"));
  setInterval(slow, SLOW_MS);
  requestAnimationFrame(frame);
}

begin().catch((error) => {
  setError("page", error.message);
  onSession(() => location.reload());
});
// A recording has other signals than the stream.
const shown = scope.showRecordings.bind(scope);
scope.showRecordings = (found) => { shown(found); show(); };
