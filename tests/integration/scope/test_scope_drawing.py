"""Drawing of the scope's page: each cycle is drawn, and the pixels do not depend on the path."""

import itertools
import re
from collections.abc import Iterator
from typing import Any

import pytest
import rtcf
from browser import Page
from daemon_process import Daemon
from rtcf_shared import spec
from scope_pages import Opener, add_drawing
from scope_process import ScopeProcess, looping


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop of 2 kHz whose values are hard to draw."""
    components = [rtcf.component("rtcf_test", "Ragged", name="ragged")]
    with looping(tmp_path_factory.mktemp("loop"), components, 2000.0) as daemon:
        yield daemon


@pytest.fixture
def visit(visit: Opener, scope: ScopeProcess) -> Opener:
    """Return a function that opens a page with a layout, with the helpers of `drawing`."""

    def visit_with_drawing(
        layout: str = "", ratio: float = 1, width: int = 1280, height: int = 800
    ) -> Page:
        page = visit(scope, layout)
        page.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height,
            deviceScaleFactor=ratio, mobile=False,
        )  # fmt: skip
        add_drawing(page)
        return page

    return visit_with_drawing


# Seeds, seconds in view, pixel ratios, and seconds drawn: several times those in view.
_DRAWN = [
    *[(1, 5, 1, 15), (4, 1, 1.25, 8), (6, 0.05, 2, 2)],
    *[
        pytest.param(*each, marks=pytest.mark.long)
        for each in [
            *[(1, 5, 1, 60), (2, 5, 1, 60), (3, 5, 2, 60), (4, 1, 1.25, 40), (5, 0.3, 1, 12)],
            (7, 60, 1, 60),
        ]
    ],
]


@pytest.mark.parametrize(("seed", "span", "ratio", "length"), _DRAWN)
def test_incremental_drawing_matches_drawing_at_once(
    visit: Opener, seed: int, span: float, ratio: float, length: float
) -> None:
    page = visit(ratio=ratio)
    found = page.ask(
        f"""(async () => {{
          const random = drawing.randomOf({seed});
          const names = Array.from({{ length: 10 }}, (_, i) => `/made.x${{i}}`);
          const made = await drawing.scopeOf([names.slice(0, 3), [names[3]], names.slice(4)]);
          made.view.span = {span};
          const source = new drawing.Source(names, 2000, random);
          const length = {length}, found = [];
          let checks = 0, now = 0;
          while (source.time < length) {{
            now += 16 + random();
            while (source.time < now / 1000)
              made.live.push(source.next(1 + Math.floor(random() * 60)), names);
            made.frame(now);
            if (random() < 6 / (length * 60)) {{
              found.push(...drawing.differences(made, now)); checks++; }}
          }}
          found.push(...drawing.differences(made, now));
          return {{ found: found.slice(0, 5), checks, end: made.live.end, lost: made.live.lost,
            tiles: made.panes.map((pane) => pane.tiles.tiles.length) }};
        }})()"""
    )  # fmt: skip
    assert found["found"] == []
    assert found["end"] > 1000 * length


def test_a_moved_and_zoomed_view_matches_drawing_at_once(visit: Opener) -> None:
    page = visit()
    page.ask(
        """(async () => {
          const names = ["/made.x0", "/made.x1", "/made.x2"], made = await drawing.scopeOf([names]);
          const random = drawing.randomOf(11), source = new drawing.Source(names, 2000, random);
          for (let i = 0; i < 400; i++) made.live.push(source.next(100), names);
          made.frame(0);
          made.freeze();
          drawing.move = () => {
            if (random() < 0.5) made.view.pan((random() - 0.5) * made.view.span);
            else made.view.zoom(0.5 + random(), made.view.end - random() * made.view.span);
            made.view.end = Math.min(made.view.end, made.live.lastTime);
            made.live.push(source.next(40), names);
            made.changed();
            return drawing.differences(made).slice(0, 5);
          };
        })()"""
    )
    for _ in range(60):
        assert page.ask("drawing.move()") == []


def test_cycles_dropped_from_the_ring_disappear_from_the_drawing(visit: Opener) -> None:
    page = visit()
    found = page.ask(
        """(async () => {
          const { Store } = await import("/page/data/store.js");
          const random = drawing.randomOf(12), names = ["/made.x0", "/made.x1", "/made.x2"];
          const made = await drawing.scopeOf([names]);
          made.live = new Store(8192);
          made.view.span = 5;
          const source = new drawing.Source(names, 2000, random), found = [];
          let now = 0;
          while (source.time < 20) {
            now += 16;
            while (source.time < now / 1000) made.live.push(source.next(40), names);
            made.frame(now);
            if (random() < 0.02) found.push(...drawing.differences(made, now));
          }
          return { found: found.slice(0, 5), begin: made.live.begin };
        })()"""
    )
    assert found["begin"] > 0
    assert found["found"] == []


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080), (420, 500)])
def test_each_spike_of_one_cycle_is_drawn(visit: Opener, width: int, height: int) -> None:
    layout = '{"panes":[{"traces":["/ragged.spikes"]},{"traces":["/ragged.holes"]}],"span":5}'
    page = visit(layout, width=width, height=height)
    page.wait("scope.live.end > 14000 && scope.panes.length === 2")
    for span in (5, 2, 0.5, 0.1):
        page.ask(f"scope.view.span = {span}; scope.changed()")
        page.wait(
            f"Math.abs(scope.panes[0].sight.seconds * scope.panes[0].sight.width - {span}) < 1e-9"
        )
        found = page.ask(
            """(async () => {
              scope.frame();
              const wrong = drawing.differences(scope);
              const { count, found } = await drawing.unseen(scope, "/ragged.spikes",
                (value) => value === 3);
              return { wrong: wrong.slice(0, 5), count, found: found.slice(0, 5),
                lost: scope.live.lost };
            })()"""
        )
        assert found["wrong"] == []
        assert found["found"] == [], span
        assert span < 1 or found["count"] > 10
    assert page.errors == []


def test_nan_values_are_marked(visit: Opener) -> None:
    # With this scale the wave itself stays above the marks at the bottom.
    page = visit('{"panes":[{"traces":["/ragged.holes"],"scale":{"low":-2,"high":2}}],"span":5}')
    found = page.wait(
        """(() => {
          scope.frame();
          const [pane] = scope.panes, { sight } = pane, [columns] = drawing.pixels(scope);
          const store = scope.live, values = store.column("/ragged.holes");
          const marked = new Set(), holes = new Set(), all = new Set();
          // Columns at the edges of the view may show cycles outside of it.
          const inner = store.find(scope.view.begin + 0.1);
          const first = Math.max(store.find(scope.view.begin) - 2, store.begin);
          for (let at = first; at < store.end; at++) {
            if (!values.isOdd(at)) continue;
            const column = Math.floor(sight.column(store.time(at)));
            all.add(column);
            if (at >= inner && at < store.end - 1) holes.add(column);
          }
          const paper = columns.get(sight.first)[2];
          const bottom = sight.height - 5;
          for (const [column, pixels] of columns)
            if (pixels.slice(bottom, bottom + 4).some((each) => each !== paper
              && each !== columns.get(column)[2])) marked.add(column);
          if (holes.size < 20) return null;
          const unmarked = [...holes].filter((each) => columns.has(each) && !marked.has(each));
          const wrong = [...marked].filter((each) =>
            ![-1, 0, 1].some((by) => all.has(each + by)));
          return { holes: holes.size, unmarked: unmarked.length, wrong: wrong.length };
        })()"""
    )
    assert found["unmarked"] == 0
    assert found["wrong"] == 0
    # Text also names the present value.
    page.wait("document.querySelector('.chip b').textContent === 'NaN'")


# The cycles before and after; how many the page lost; whether the shade is red, not grey.
@pytest.mark.parametrize(
    ("first", "lost", "is_red"),
    [(1200, 200, True), (0, 0, False)],
    ids=["missing cycles", "a pause of the loop"],
)
def test_times_without_cycles_are_shaded(
    visit: Opener, first: int, lost: int, is_red: bool
) -> None:
    page = visit()
    found = page.ask(
        f"""(async () => {{
          const {{ ink, pixel }} = await import("/page/drawing/palette.js");
          const made = await drawing.scopeOf([["/made.x"]]);
          const batch = (time, first, count, lost) => {{
            const times = Float64Array.from({{ length: count }}, (_, i) => time + i / 1000);
            const cycles = Float64Array.from({{ length: count }}, (_, i) => first + i);
            const zeros = new Float64Array(count);
            return {{ count, lost, times, cycles, latencies: zeros, durations: zeros,
              traces: [zeros] }};
          }};
          made.view.span = 2;
          made.live.push(batch(0, 0, 1000, 0), ["/made.x"]);
          made.live.push(batch(1.2, {first}, 800, {lost}), ["/made.x"]);
          made.frame(0);
          made.freeze();
          made.view.end = 2;
          made.changed();
          made.frame(1);
          const {{ sight }} = made.panes[0], [columns] = drawing.pixels(made);
          const paper = pixel(ink("paper"));
          const ground = (time) => columns.get(Math.floor(sight.column(time)))[3];
          const parts = (colour) => [0, 8, 16].map((by) => (colour >> by) & 255);
          return {{ before: ground(0.9) === paper, after: ground(1.3) === paper,
            within: [1.01, 1.1, 1.19].map((time) => parts(ground(time))),
            paper: parts(paper), gaps: made.live.gaps, lost: made.live.lost }};
        }})()"""
    )
    assert found["before"] and found["after"]
    for red, green, blue in found["within"]:
        assert [red, green, blue] != found["paper"]
        assert (red > green + 20 and red > blue + 20) == is_red
    assert [gap["cycles"] for gap in found["gaps"]] == [lost]
    assert found["lost"] == lost


@pytest.mark.parametrize(
    ("low", "high", "notes"),
    [
        (1.3701e6, 1.3703e6, "×10⁶"), (1.37e6, 1.372e6, "×10⁶"), (-2.5e6, 2.5e6, "×10⁶"),
        (1.370201e6, 1.370202e6, "+ 1 370 200"), (1e12, 1e12 + 10, "+ 1 000 000 000 000"),
        (-1.370202e6, -1.370201e6, "− 1 370 210"), (2e-7, 3e-7, "×10⁻⁹"), (0.0, 1.0, ""),
        (12345.0, 12346.0, ""), (-30.0, 50.0, ""), (5e20, 7e20, "×10¹⁸"),
    ],
)  # fmt: skip
def test_tick_labels_are_short_and_distinct(
    visit: Opener, low: float, high: float, notes: str
) -> None:
    page = _blank(visit)
    found = page.ask(
        f"""(async () => {{
          const {{ ticks, tickTexts }} = await import("/page/drawing/axes.js");
          const {{ at, step }} = ticks({low!r}, {high!r}, 5);
          return {{ at, ...tickTexts(at, step) }};
        }})()"""
    )
    texts = found["texts"]
    assert 3 <= len(texts) == len(set(texts)) == len(found["at"])
    assert max(map(len, texts)) <= 9
    assert found["note"].replace("\u202f", " ") == notes
    # Each label can be converted back to its value.
    factor, base = _note(found["note"])
    for text, value in zip(texts, found["at"], strict=True):
        said = float(text.replace("−", "-").replace("\u202f", "")) * factor + base
        assert said == pytest.approx(value, rel=1e-12, abs=1e-3 * (high - low))


@pytest.mark.parametrize("height", [40, 55, 80, 200, 900])
@pytest.mark.parametrize("high", [1.0, 1.5, 2.75, 3.0, 7.5])
def test_a_value_axis_has_two_ticks_at_least_which_do_not_overlap(
    visit: Opener, height: int, high: float
) -> None:
    rows = _blank(visit).ask(
        f"""(async () => {{
          const {{ Sight }} = await import("/page/drawing/sight.js");
          const scale = {{ low: -{high!r}, high: {high!r} }};
          const sight = new Sight({{ begin: 0, span: 5 }}, scale, 600, {height}, 1);
          return sight.rows.at.map((value) => sight.y(value));
        }})()"""
    )
    assert len(rows) >= 2
    assert min(abs(a - b) for a, b in itertools.pairwise(rows)) >= 12


def _note(text: str) -> tuple[float, float]:
    """Return the factor and the offset of tick labels."""
    factor = 1.0
    power = re.match(r"×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", text)
    if power:
        factor = 10.0 ** int("".join("-0123456789"["⁻⁰¹²³⁴⁵⁶⁷⁸⁹".index(c)] for c in power[1]))
        text = text[power.end() :]
    plain = text.replace("\u202f", "").replace(" ", "").replace("−", "-")
    return factor, float(plain) if plain else 0.0


def _blank(visit: Opener) -> Page:
    return visit()


def test_numbers_above_a_million_are_readable(visit: Opener) -> None:
    page = visit('{"panes":[{"traces":["/ragged.large"]}],"span":5}')
    found: Any = page.ask(
        """(async () => {
          const { figure } = await import("/page/drawing/axes.js");
          return [1370201.4, 12345.6, 0.00012346, -2e6, 1.5e13, 3].map((each) => figure(each));
        })()"""
    )
    assert [each.replace("\u202f", " ") for each in found] == [
        "1 370 201", "12 346", "0.00012346", "−2 000 000", "1.5000e13", "3",
    ]  # fmt: skip
    page.wait("/^1.370.[0-9]{3}$/.test(document.querySelector('.chip b').textContent)")


def test_the_spectrum_shows_the_frequency_of_a_wave(visit: Opener) -> None:
    page = _blank(visit)
    found = page.ask(
        """(async () => {
          const f = await import("/page/data/fft.js"),
            { hertzText } = await import("/page/panels/spectrum.js");
          const told = (hertz, seconds, rate, phase) => {
            const values = Float64Array.from({ length: seconds * rate },
              (_, i) => 2 + 3 * Math.sin(2 * Math.PI * hertz * i / rate + phase));
            const of = f.spectrum(values, rate),
              { frequency, amplitude } = f.peak(of, f.highest(of));
            return [hertzText(frequency, of.resolution), amplitude];
          };
          return [told(1, 5, 2000, 0.3), told(1, 7.3, 2000, 1), told(1.7, 10, 2000, 2),
            told(50, 5, 2000, 0), told(123.4, 2, 1000, 1)];
        })()"""
    )
    assert [text for text, _ in found] == ["1 Hz", "1 Hz", "1.7 Hz", "50 Hz", "123.4 Hz"]
    for _, amplitude in found:
        assert amplitude == pytest.approx(3.0, rel=5e-3)


def test_a_periodic_signal_has_no_settling_time(visit: Opener) -> None:
    page = _blank(visit)
    found = page.ask(
        """(async () => {
          const { step } = await import("/page/data/measure.js");
          const times = Array.from({ length: 10000 }, (_, i) => i / 2000);
          const square = (t) => Math.sign(Math.sin(2 * Math.PI * (t * 1.1 + 0.52)));
          const hunting = (t) => t < 1 ? 0 : 1 + 0.03 * Math.sin(20 * t);
          return { square: step(times, times.map(square)),
            hunting: step(times, times.map(hunting)),
            once: step(times, times.map((t) => t < 2 ? 0 : 1)) };
        })()"""
    )
    assert found["square"] == {"rise": None, "overshoot": None, "settling": None, "why": ""}
    assert found["once"]["settling"] is not None
    assert found["hunting"]["settling"] is None


def test_events_are_lines_with_a_label_in_the_top_pane(visit: Opener, loop: Daemon) -> None:
    page = visit('{"panes":[{"traces":["/ragged.spikes"]},{"traces":["/ragged.holes"]}],"span":5}')
    page.wait("scope.rate && !scope.live.empty && scope.panes.length === 2")
    with rtcf.Client(loop.socket) as client:
        client.set_parameters("ragged", [spec.parse_parameter("seed:=2")])
    page.wait("document.querySelector('.mark.change span')?.textContent.includes('parameters')")
    found = page.ask(
        """[...document.querySelectorAll('.pane')].map((pane) => ({
          lines: pane.querySelectorAll('.mark.change').length,
          labels: pane.querySelectorAll('.mark.change span').length,
          title: pane.querySelector('.mark.change span')?.title }))"""
    )
    assert found[0]["lines"] == found[1]["lines"] >= 1
    assert (found[0]["labels"], found[1]["labels"]) == (found[0]["lines"], 0)
    assert "seed" in found[0]["title"]
    # A line is at the cycle of its event, at any position of the view.
    page.ask("scope.freeze(); scope.view.span = 7; scope.changed(); scope.frame()")
    away = page.ask(
        """(() => {
          const [pane] = scope.panes, mark = scope.marks().find((each) => each.ink === "change");
          scope.view.end = mark.time + 2;
          scope.changed();
          scope.frame();
          const line = pane.plot.querySelector(".mark.change").getBoundingClientRect();
          return line.left - pane.plot.getBoundingClientRect().left - pane.sight.x(mark.time);
        })()"""
    )
    assert abs(away) <= 1


def test_only_the_second_of_two_recordings_is_dashed(visit: Opener) -> None:
    page = visit()
    found = page.ask(
        """(async () => {
          const { ink, pixel } = await import("/page/drawing/palette.js");
          const { Store } = await import("/page/data/store.js");
          const names = Array.from({ length: 18 }, (_, i) => `/made.x${i}`);
          const made = await drawing.scopeOf([names]);
          const count = 4000, zeros = new Float64Array(count);
          const store = (more) => Store.of({ count, lost: 0, times: zeros.map((_, i) => i / 1000),
            cycles: zeros.map((_, i) => i), latencies: zeros, durations: zeros,
            traces: names.map((_, i) => new Float64Array(count).fill(i + more)) }, names);
          made.showRecordings([{ name: "a", store: store(0) }, { name: "b", store: store(0.5) }]);
          made.view.show(0.5, 3.5);
          made.changed();
          made.frame();
          // The number of frequent pixel colours of a flat line, and the columns with the
          // background: the symbols from the ninth trace on have a rim of it.
          const { sight } = made.panes[0], [columns] = drawing.pixels(made),
            paper = pixel(ink("paper"));
          const told = (value) => {
            const row = Math.floor(sight.row(value)), counts = new Map();
            for (const pixels of columns.values()) counts.set(pixels[row],
              (counts.get(pixels[row]) ?? 0) + 1);
            const often = [...counts.values()].filter((each) => each > columns.size / 8);
            return { kinds: often.length, ground: counts.get(paper) ?? 0 };
          };
          return { first: names.map((_, i) => told(i)),
            second: names.slice(0, 8).map((_, i) => told(i + 0.5)) };
        })()"""
    )
    assert [each["kinds"] for each in found["first"]] == [1] * 18
    assert [each["kinds"] for each in found["second"]] == [2] * 8
    # The gaps between the dashes do not show the background.
    assert not any(each["ground"] for each in found["first"][:8] + found["second"])
    assert [each["ground"] > 0 for each in found["first"]] == [False] * 8 + [True] * 10


def test_browser_controls_have_the_colours_of_the_theme(visit: Opener) -> None:
    page = _blank(visit)
    for theme in ("dark", "light"):
        page.ask(f"document.documentElement.dataset.theme = '{theme}'")
        assert page.ask("getComputedStyle(document.querySelector('aside')).colorScheme") == theme
