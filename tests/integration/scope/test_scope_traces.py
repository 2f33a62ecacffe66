"""Scales, tracks and axes of the scope's panes, values under the pointer, and bars that resize."""

import json
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import rtcf
from browser import Page
from daemon_process import Daemon
from scope_pages import Opener, add_drawing
from scope_process import ScopeProcess, looping

_RATE_HZ = 1000.0


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop of two waves and a counter."""
    components = [
        rtcf.component("rtcf_examples", "Wave", name="w0", parameters=["rate:=1.0"]),
        rtcf.component(
            "rtcf_examples", "Wave", name="w1", parameters=["rate:=2.0", "amplitude:=8.0"]
        ),
        rtcf.component("rtcf_test", "Counter", name="count"),
    ]
    with looping(tmp_path_factory.mktemp("loop"), components, _RATE_HZ) as daemon:
        yield daemon


@pytest.fixture(scope="module")
def recordings(loop: Daemon, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return two recordings of the loop."""
    files = [tmp_path_factory.mktemp("recordings") / f"{name}.mcap" for name in ("one", "two")]
    for file in files:
        done = loop.ctl("record", "-o", str(file), "w0", "--duration", "1.5s")
        assert done.returncode == 0, done.stderr
    return files


@pytest.fixture(scope="module")
def scope(loop: Daemon, recordings: list[Path]) -> Iterator[ScopeProcess]:
    with ScopeProcess(loop, *map(str, recordings)) as scope:
        yield scope


@pytest.fixture
def visit(visit: Opener, scope: ScopeProcess) -> Opener:
    """Return a function that opens a page with a layout, with the helpers of `drawing`."""

    def visit_with_drawing(layout: Any = None) -> Page:
        page = visit(scope, json.dumps(layout) if layout is not None else "")
        add_drawing(page)
        return page

    return visit_with_drawing


def _choose_axis(page: Page, pane: int, trace: int, axis: str) -> None:
    page.ask(
        f"""(() => {{
          const select = scope.panes[{pane}].legend.querySelectorAll("select")[{trace}];
          select.value = {axis!r};
          select.dispatchEvent(new Event("change"));
          scope.frame();
        }})()"""
    )


def _mouse(page: Page, kind: str, x: float, y: float, **words: Any) -> None:
    page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **words)


def _drag(page: Page, begin: tuple[float, float], end: tuple[float, float], **words: Any) -> None:
    _mouse(page, "mousePressed", *begin, button="left", clickCount=1, **words)
    for part in (0.5, 1.0):
        x, y = (a + part * (b - a) for a, b in zip(begin, end, strict=True))
        _mouse(page, "mouseMoved", x, y, button="left", **words)
    _mouse(page, "mouseReleased", *end, button="left", clickCount=1, **words)


def _press(page: Page, text: str) -> None:
    """Press a button of the recordings."""
    page.ask(
        "[...document.querySelectorAll('#recordings .group button')]"
        f".find((each) => each.textContent === {text!r}).click()"
    )


def _box(page: Page, element: str) -> tuple[float, float, float, float]:
    """Return left, top, width and height of the element that an expression returns."""
    left, top, width, height = page.ask(
        f"(() => {{ const box = {element}.getBoundingClientRect();"
        " return [box.left, box.top, box.width, box.height]; })()"
    )
    return left, top, width, height


def test_a_signal_is_shown_in_two_panes(visit: Opener) -> None:
    page = visit(
        {"panes": [{"traces": ["/w1.wave"]}, {"traces": ["/w0.wave", "/w1.wave"]}], "span": 1}
    )
    page.wait("scope.live.end > 1200 && scope.panes.length === 2")
    page.ask("scope.freeze(); scope.frame()")
    for pane in (0, 1):
        found = page.ask(
            f"""(async () => {{
              const panes = [scope.panes[{pane}]], {{ live: store, view }} = scope;
              return drawing.unseen({{ panes, store, view }}, "/w1.wave", () => true);
            }})()"""
        )
        assert found["count"] > 500
        assert found["found"] == []
    assert page.ask("scope.panes.map((pane) => pane.traces.map((each) => each.number))") == [
        [0], [1, 0],
    ]  # fmt: skip
    # It is measured once, and each pane's cross removes it from that pane.
    page.wait("document.querySelectorAll('.drawer tbody tr').length === 2")
    page.ask("scope.panes[1].legend.querySelectorAll('.chip > button')[1].click()")
    assert page.ask("scope.panes.map((pane) => pane.traces.map((each) => each.name))") == [
        ["/w1.wave"], ["/w0.wave"],
    ]  # fmt: skip
    # A click in the list changes the active pane.
    leaf = "[...document.querySelectorAll('#tree .leaf')].find((each) => each.title === '/w1.wave')"
    page.ask("scope.activate(scope.panes[1])")
    assert page.ask(f"{leaf}.getAttribute('aria-pressed')") == "false"
    page.ask(f"{leaf}.click()")
    assert page.ask(f"{leaf}.getAttribute('aria-pressed')") == "true"
    assert page.ask("scope.panes.every((pane) => pane.has('/w1.wave'))")
    assert page.errors == []


@pytest.mark.parametrize("axis", ["right", "own"])
def test_a_trace_has_an_axis_of_its_own(visit: Opener, axis: str) -> None:
    page = visit(
        {"panes": [{"traces": ["/w0.wave", "/w1.wave"]}, {"traces": ["/w0.wave"]}], "span": 2}
    )
    page.wait("scope.live.end > 2200 && scope.panes.length === 2")
    page.ask("scope.freeze(); scope.frame()")
    before = page.ask("scope.panes[0].shown")
    _choose_axis(page, 0, 1, axis)
    found = page.ask(
        """(async () => {
          scope.frame();
          const [pane] = scope.panes, [one, other] = pane.drawn.map((each) => each.sight);
          // The share of the cycles that are not drawn at the position on their scale.
          const seen = async (name, sight) => {
            const { traces, tiles } = pane, { live: store, view } = scope;
            const panes = [{ has: () => true, sight, traces, tiles }];
            const { found, count } = await drawing.unseen({ panes, store, view }, name, () => true);
            return found.length / count;
          };
          return { shown: pane.shown, own: [other.low, other.high],
            one: await seen("/w0.wave", one), other: await seen("/w1.wave", other) };
        })()"""
    )
    assert before["high"] > 8
    assert 1 < found["shown"]["high"] < 2
    assert found["own"][1] > 8
    # The second one is drawn over the first one.
    assert found["one"] < 0.1
    assert found["other"] == 0
    # An exported plot has the axes in the same colours.
    inks = page.ask(
        """(() => {
          const [pane] = scope.panes, { clientWidth: width, clientHeight: height } = pane.face;
          const canvas = Object.assign(document.createElement("canvas"), { width, height });
          const g = canvas.getContext("2d");
          pane.paint(g, width, height, 1);
          const edge = pane.plot.offsetLeft + pane.plot.clientWidth + 2;
          return [[0, 60], [edge, width - edge]].map(([left, wide]) => {
            const { data } = g.getImageData(left, 20, wide, height - 50);
            return new Set(new Uint32Array(data.buffer)).size > 1;
          });
        })()"""
    )
    assert inks == [True, axis == "right"]
    badge = page.ask("scope.panes[0].legend.querySelectorAll('.badge')[1].textContent")
    if axis == "right":
        assert badge == "right"
        # All panes are as wide as this one.
        left, _, width, _ = _box(page, "scope.panes[0].plot")
        assert _box(page, "scope.panes[1].plot")[0::2] == (left, width)
        assert page.ask("scope.panes[0].rightValues.canvas.offsetLeft") == pytest.approx(
            left + width - _box(page, "scope.panes[0].face")[0], abs=1
        )
    else:
        assert re.fullmatch("\u2212\\d+ … \\d+", badge)
    # A bookmark keeps it.
    page.wait(
        f'decodeURIComponent(location.hash).includes(\'{{"name":"/w1.wave","axis":"{axis}"}}\')'
    )
    other = visit(json.loads(page.ask("decodeURIComponent(location.hash.slice(1))")))
    other.wait("scope.live.end > 100")
    assert other.ask("scope.panes[0].traces.map((each) => scope.panes[0].axisOf(each))") == [
        "left",
        axis,
    ]
    assert page.errors == other.errors == []


def test_the_wheel_beside_the_plot_zooms_the_scale_there(visit: Opener) -> None:
    page = visit(
        {"panes": [{"traces": ["/w0.wave", {"name": "/w1.wave", "axis": "right"}]}], "span": 2}
    )
    page.wait("scope.live.end > 2200 && scope.panes[0].drawn.length === 2")
    page.ask("scope.freeze(); scope.frame()")
    left, top, width, height = _box(page, "scope.panes[0].face")
    scales = "(() => { const [p] = scope.panes; return [p.left.set, p.right.set]; })()"
    assert page.ask(scales) == [None, None]
    _mouse(page, "mouseWheel", left + width - 20, top + height / 2, deltaX=0, deltaY=-200)
    page.wait(f"{scales}[1] !== null")
    assert page.ask(f"{scales}[0]") is None
    assert page.ask("scope.panes[0].right.set.high") < 8
    _mouse(page, "mouseWheel", left + 20, top + height / 2, deltaX=0, deltaY=-200)
    page.wait(f"{scales}[0] !== null")
    page.ask("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'a', bubbles: true}))")
    assert page.ask(scales) == [None, None]


def test_booleans_and_integers_are_tracks_below_each_other(visit: Opener) -> None:
    page = visit(
        {"panes": [{"traces": ["/w0.wave", "/w0.above", "/w1.above",
                               {"name": "/count.out", "axis": "track"}]},
                   {"traces": ["/w0.above"]}], "span": 2}
    )  # fmt: skip
    page.wait("scope.live.end > 2200 && scope.kinds.get('/w0.above') === 'bool'")
    assert page.ask("scope.kinds.get('/count.out')") == "integer"
    page.ask("scope.freeze(); scope.frame()")
    found = page.ask(
        """(async () => {
          const { ink, pixel } = await import("/page/drawing/palette.js");
          const { live, panes: [pane, below] } = scope, { sight } = pane, wrong = [];
          const [columns] = drawing.pixels(scope);
          const ground = [pixel(ink("paper")), pixel(ink("grid"))];
          let count = 0;
          for (const trace of pane.drawn.filter(({ name }) => name.endsWith("above"))) {
            const values = live.column(trace.name), row = Math.round(trace.sight.row(1)) + 3;
            for (let x = sight.first + 20; x < sight.first + sight.width - 20; x++) {
              // The value before a column and those in it: a true one colours the area.
              const [first, last] = [x, x + 1].map((each) => live.find(each * sight.seconds));
              const those = [];
              for (let at = first - 1; at < last; at++) those.push(values.get(at));
              if (those.some(Number.isNaN)) continue;
              count++;
              const isGround = ground.includes(columns.get(x)[row]);
              if (isGround === those.includes(1)) wrong.push([trace.name, x, those]);
            }
          }
          const tracks = pane.drawn.filter(({ track }) => track).map(({ track }) => track);
          return { wrong: wrong.slice(0, 5), count, tracks, height: sight.height,
            bottom: sight.bottom, alone: below.drawn[0].track,
            names: [...pane.names.children].map((each) => each.textContent) };
        })()"""
    )
    assert found["wrong"] == []
    assert found["count"] > 500
    first, second, third = found["tracks"]
    assert first["first"] == found["bottom"] > found["height"] / 3
    assert (first["last"], second["last"]) == (second["first"], third["first"])
    assert third["last"] == found["height"]
    assert found["alone"]["first"] == 0
    assert found["names"][:2] == ["/w0.above", "/w1.above"]
    assert re.fullmatch(r"/count\.out  \S+ … \S+", found["names"][2].replace("\u202f", ""))
    # The line does not reach into the tracks, and a track becomes a line if that axis is chosen.
    _choose_axis(page, 0, 1, "left")
    assert page.ask("scope.panes[0].drawn[1].track") is None
    assert page.errors == []


@pytest.mark.parametrize(
    ("seed", "span", "ruler"), [(1, 5, "cycles"), (2, 1, "clock"), (3, 0.05, "cycles")]
)
def test_tracks_and_other_axes_that_grew_are_the_ones_drawn_at_once(
    visit: Opener, seed: int, span: float, ruler: str
) -> None:
    page = visit()
    found = page.ask(
        f"""(async () => {{
          const random = drawing.randomOf({seed});
          const names = Array.from({{ length: 8 }}, (_, i) => `/made.x${{i}}`);
          const made = await drawing.scopeOf([names.slice(0, 4), names.slice(4)]);
          const axes = ["track", "left", "right", "own"];
          for (const pane of made.panes) {{
            pane.traces.forEach((trace, i) => {{ trace.axis = axes[i % 4]; }});
            pane.describe();
          }}
          made.baseNs = 1_700_000_000_123_456_789n;
          made.rate = 2000;
          made.setRuler({ruler!r});
          made.view.span = {span};
          const source = new drawing.Source(names, 2000, random), found = [];
          let now = 0;
          while (source.time < Math.min(10, 8 * {span})) {{
            now += 16 + random();
            while (source.time < now / 1000)
              made.live.push(source.next(1 + Math.floor(random() * 60)), names);
            made.frame(now);
            if (random() < 0.03) found.push(...drawing.differences(made, now));
          }}
          found.push(...drawing.differences(made, now));
          const text = made.panes[0].times.strip.box.textContent;
          return {{ found: found.slice(0, 5), text }};
        }})()"""
    )
    assert found["found"] == []
    assert found["text"]


def test_the_time_axis_shows_the_time_of_day_and_cycle_numbers(visit: Opener) -> None:
    page = visit({"panes": [{"traces": ["/w0.wave"]}], "span": 5, "ruler": "clock"})
    page.wait("scope.live.end > 6000 && scope.rate")
    page.ask("scope.freeze(); scope.frame()")
    ticks = """(() => {
      const [{ sight, times }] = scope.panes, away = times.strip.origin - sight.first;
      return [...times.shown.values()].map((each) => (
        { text: each.textContent, x: parseFloat(each.style.left) + away }));
    })()"""
    found = page.ask(ticks)
    assert len(found) >= 4
    moments = page.ask(
        f"{ticks}.map(({{ x }}) =>"
        " Number(scope.baseNs / 1000n) / 1e6 + scope.panes[0].sight.time(x))"
    )
    resolution = page.ask("scope.panes[0].sight.seconds")
    for tick, moment in zip(found, moments, strict=True):
        assert re.fullmatch(r"\d\d:\d\d:\d\d(\.\d+)?", tick["text"])
        here = datetime.fromtimestamp(moment)
        midnight = here.replace(hour=0, minute=0, second=0, microsecond=0)
        hour, minute, second = tick["text"].split(":")
        told = int(hour) * 3600 + int(minute) * 60 + float(second)
        assert told == pytest.approx((here - midnight).total_seconds(), abs=2 * resolution)
        assert float(second) % 0.5 == 0
    # A click on the unit selects the next kind, cycle numbers.
    unit = "scope.panes[0].times.unit"
    assert page.ask(f"{unit}.textContent") == "clock"
    page.ask(f"{unit}.click(); scope.frame()")
    assert page.ask(f"{unit}.textContent") == "cycle"
    cycles = page.ask(
        f"""{ticks}.map(({{ text, x }}) => {{
          const at = scope.live.nearest(scope.panes[0].sight.time(x));
          return [Number(text.replace(/\\u202f/g, "")), scope.live.cycle(at)];
        }})"""
    )
    assert len(cycles) >= 4
    per_column = resolution * _RATE_HZ
    for told, there in cycles:
        assert told % 100 == 0
        assert abs(told - there) <= 2 * per_column + 1
    assert len({told for told, _ in cycles}) == len(cycles)
    page.wait('decodeURIComponent(location.hash).includes(\'"ruler":"cycles"\')')
    page.ask(
        "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'x', bubbles: true}));"
        "scope.frame()"
    )
    assert page.ask(f"{unit}.textContent") == "s"
    assert page.errors == []


def test_times_of_day_have_the_digits_of_their_step(visit: Opener) -> None:
    page = visit()
    assert page.ask(
        """(async () => {
          const { clockText, rulerOf } = await import("/page/drawing/ruler.js");
          const words = { span: 7200, width: 1000, zero: 86000, store: scope.live, rate: 1 };
          const day = rulerOf("clock", words);
          return [clockText(3661.25, 0.05), clockText(86399.9996, 0.001), clockText(-1, 1),
            clockText(45296.789012, 1e-6),
            ...day.ticks(0, 3600).slice(0, 3).map((tick) => [tick.time, day.text(tick)])];
        })()"""
    ) == [
        "01:01:01.25", "00:00:00.000", "23:59:59", "12:34:56.789012",
        [400, "00:00:00"], [1300, "00:15:00"], [2200, "00:30:00"],
    ]  # fmt: skip


def test_the_values_under_the_pointer_are_those_of_its_cycle(visit: Opener) -> None:
    page = visit(
        {
            "panes": [
                {"traces": ["/w0.wave", "/w1.wave", "/w0.above"]},
                {"traces": ["/count.out"]},
            ],
            "span": 2,
        }
    )
    page.wait("scope.live.end > 2200 && scope.panes.length === 2")
    page.ask("scope.freeze(); scope.frame()")
    left, top, width, height = _box(page, "scope.panes[0].plot")
    x, y = round(left + 0.3 * width), round(top + 0.4 * height)
    _mouse(page, "mouseMoved", x, y)
    shown = "document.querySelector('.readout:not([hidden])')"
    page.wait(f"!!{shown}")
    told = page.ask(
        f"""(async () => {{
          const {{ figure }} = await import("/page/drawing/axes.js");
          const at = scope.live.nearest(scope.panes[0].sight.time({x} - {left}));
          const rows = [...{shown}.querySelectorAll(":scope > div p")]
            .map((row) => [1, 2].map((each) => row.children[each].textContent));
          const values = scope.panes[0].traces
            .map((each) => [each.name, figure(scope.live.column(each.name).get(at))]);
          const count = (name) => document.querySelectorAll(`${{name}}:not([hidden])`).length;
          return {{ head: {shown}.querySelector("p").textContent, rows, values,
            cycle: scope.live.cycle(at), boxes: count(".readout"), lines: count(".hair") }};
        }})()"""
    )
    assert told["rows"] == told["values"]
    assert f"cycle {told['cycle']}" in told["head"]
    assert re.search(r" s · \d\d:\d\d:\d\d\.\d+ · ", told["head"])
    # The line is in all panes, the box in one.
    assert (told["boxes"], told["lines"]) == (1, 2)
    # The box stays within the pane at each corner, and disappears outside of the panes.
    for part in ((0.02, 0.02), (0.98, 0.02), (0.02, 0.95), (0.98, 0.95)):
        _mouse(page, "mouseMoved", round(left + part[0] * width), round(top + part[1] * height))
        page.wait(f"!!{shown}")
        box, face = _box(page, shown), _box(page, "scope.panes[0].face")
        assert box[0] >= face[0] and box[0] + box[2] <= face[0] + face[2]
        assert box[1] >= face[1] and box[1] + box[3] <= face[1] + face[3]
    _mouse(page, "mouseMoved", 5, 5)
    page.wait(f"!{shown}")
    page.ask("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'v', bubbles: true}))")
    _mouse(page, "mouseMoved", x, y)
    assert page.ask(shown) is None
    assert page.errors == []


def test_panes_list_and_drawer_are_resized_by_their_bars(visit: Opener) -> None:
    page = visit({"panes": [{"traces": ["/w0.wave"]}, {"traces": ["/w1.wave"]}, {"traces": []}]})
    page.wait("scope.panes.length === 3")
    heights = "scope.panes.map((each) => Math.round(each.box.getBoundingClientRect().height))"
    before = page.ask(heights)
    left, top, width, height = _box(page, "scope.panes[1].bar")
    middle = (left + width / 2, top + height / 2)
    _drag(page, middle, (middle[0], middle[1] + 50))
    after = page.ask(heights)
    assert after == pytest.approx([before[0] + 50, before[1] - 50, before[2]], abs=2)
    page.wait("Math.abs(scope.panes[0].size.height - scope.panes[0].plot.clientHeight) < 1")
    # A bookmark keeps it; a double click restores it.
    page.wait('/"height":1\\.\\d+/.test(decodeURIComponent(location.hash))')
    other = visit(json.loads(page.ask("decodeURIComponent(location.hash.slice(1))")))
    other.wait("scope.panes.length === 3")
    assert other.ask(heights) == pytest.approx(after, abs=3)
    page.ask("scope.panes[1].bar.dispatchEvent(new MouseEvent('dblclick'))")
    assert page.ask(heights) == pytest.approx(before, abs=1)

    sizes = (
        "[document.getElementById('list').offsetWidth,"
        " document.querySelector('.drawer').offsetHeight]"
    )
    was = page.ask(sizes)
    left, top, width, height = _box(page, "document.getElementById('beside')")
    _drag(page, (left + width / 2, top + 200), (left + width / 2 + 60, top + 200))
    left, top, width, height = _box(page, "document.getElementById('above')")
    _drag(page, (left + 300, top + height / 2), (left + 300, top + height / 2 - 70))
    assert page.ask(sizes) == [was[0] + 60, was[1] + 70]
    page.ask("document.getElementById('above').focus()")
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key="ArrowDown", code="ArrowDown",
                  windowsVirtualKeyCode=40)  # fmt: skip
    assert page.ask(sizes) == [was[0] + 60, was[1] + 54]
    # The browser stores the sizes for the next page.
    other = visit()
    other.wait("scope.rate")
    assert other.ask(sizes) == [was[0] + 60, was[1] + 54]
    for bar in ("beside", "above"):
        other.ask(f"document.getElementById('{bar}').dispatchEvent(new MouseEvent('dblclick'))")
    assert other.ask(sizes) == was
    assert page.errors == other.errors == []


def test_the_second_recording_is_shifted_against_the_first(visit: Opener) -> None:
    page = visit({"panes": [{"traces": ["/w0.wave", "= d(/w0.wave)"]}]})
    page.wait("scope.rate")
    page.ask("document.querySelector('aside [data-tab=recordings]').click()")
    files = "[...document.querySelectorAll('#recordings .leaf')]"
    page.wait(f"{files}.length === 2")
    for number, name in enumerate(("one.mcap", "two.mcap")):
        page.ask(f"{files}[{number}].click()")
        page.wait(
            f"scope.recordings.length === {number + 1}"
            f" && {files}[{number}].getAttribute('aria-pressed') === 'true'"
        )
        assert page.ask(f"scope.recordings[{number}].name") == name
    field = "document.querySelector('.shift input')"
    first = "scope.recordings.map((each) => each.store.firstTime)"
    assert page.ask(first) == [0, 0]
    page.ask(f"{field}.value = '0.25'; {field}.onchange()")
    assert page.ask(first) == [0, 0.25]
    # The shifted recording is drawn at its new times.
    page.ask("scope.frame()")
    assert page.ask("drawing.differences(scope)") == []
    drawn = page.ask(
        """(() => {
          const [{ store }, { store: other }] = scope.recordings;
          scope.view.show(-0.5, 2.5);
          scope.changed();
          scope.frame();
          const [columns] = drawing.pixels(scope), { sight } = scope.panes[0];
          const kinds = (time) => new Set(columns.get(Math.floor(sight.column(time)))).size;
          const times = [store.firstTime + 0.02, other.lastTime - 0.02];
          return times.map((time) => kinds(time) > kinds(-0.2));
        })()"""
    )
    assert drawn == [True, True]
    # A new trace keeps the shift.
    page.ask("scope.toggle('/w0.phase')")
    page.wait("scope.recordings.every((each) => each.store.column('/w0.phase'))")
    assert page.ask(first) == [0, 0.25]
    # The button moves the second recording from A to B.
    page.ask("scope.setCursor('a', 0.5); scope.setCursor('b', 0.9)")
    a, b = page.ask("[scope.cursors.a, scope.cursors.b]")
    _press(page, "A → B")
    assert page.ask(first)[1] == pytest.approx(0.25 + b - a)
    # The times of the clock: the second recording began later.
    _press(page, "Clock")
    assert page.ask(first)[1] > 1
    _press(page, "Beginning")
    assert page.ask(first) == [0, 0]
    # Dragging with Alt.
    left, top, width, height = _box(page, "scope.panes[0].plot")
    y = top + height / 2
    _drag(page, (left + 0.4 * width, y), (left + 0.5 * width, y), modifiers=1)
    span = page.ask("scope.view.span")
    assert page.ask(first)[1] == pytest.approx(0.1 * span, rel=0.05)
    assert float(page.ask(f"{field}.value")) == pytest.approx(page.ask(first)[1], abs=1e-6)
    assert page.errors == []
