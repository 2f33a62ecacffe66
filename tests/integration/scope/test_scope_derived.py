"""Derived signals of the scope's page, and one signal over another."""

import math
from collections.abc import Iterator
from functools import partial

import pytest
import rtcf
from browser import Page
from daemon_process import Daemon
from scope_pages import Opener
from scope_process import ScopeProcess, looping


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop of 1 kHz, of two waves."""
    components = [
        rtcf.component("rtcf_examples", "Wave", name=name, parameters=[f"rate:={rate}"])
        for name, rate in (("w0", 1.0), ("w1", 2.0))
    ]
    with looping(tmp_path_factory.mktemp("loop"), components, 1000.0) as daemon:
        yield daemon


@pytest.fixture
def visit(visit: Opener, scope: ScopeProcess) -> Opener:
    """Return a function that opens a page of `scope` with a layout."""
    return partial(visit, scope)


def _derive(page: Page, text: str) -> None:
    page.ask(
        f"""(() => {{
          const form = document.getElementById("derive");
          form.querySelector("input").value = {text!r};
          form.requestSubmit();
        }})()"""
    )


def test_a_derivative_and_a_difference_of_a_loop_are_right(visit: Opener) -> None:
    page = visit('{"panes":[{"traces":["/w0.wave"]}],"span":2}')
    page.wait("scope.live.end > 500")
    for text in ("d(/w0.phase)", "= /w0.wave - /w1.wave"):
        _derive(page, text)
    names = page.ask("scope.traces().map((each) => each.name)")
    assert names == ["/w0.wave", "= d(/w0.phase)", "= /w0.wave - /w1.wave"]
    page.wait(
        "!!(scope.live.column('= d(/w0.phase)') && scope.live.column('= /w0.wave - /w1.wave'))"
    )
    begin = page.ask("scope.live.end")
    page.wait(f"scope.live.end > {begin + 1500}")
    found = page.ask(
        """(() => {
          const { live } = scope;
          const [slope, difference, phase, one, other] =
            ["= d(/w0.phase)", "= /w0.wave - /w1.wave", "/w0.phase", "/w0.wave", "/w1.wave"]
              .map((name) => live.column(name));
          let wrong = 0, count = 0, odd = 0;
          for (let at = live.begin + 1; at < live.end; at++) {
            if (difference.isOdd(at) || slope.isOdd(at)) odd++;
            if (slope.isBlank(at) || difference.isBlank(at)) continue;
            count++;
            const rise = (phase.get(at) - phase.get(at - 1)) / (live.time(at) - live.time(at - 1));
            if (slope.get(at) !== rise) wrong++;
            if (difference.get(at) !== one.get(at) - other.get(at)) wrong++;
          }
          return { wrong, count, odd };
        })()"""
    )
    assert found["count"] > 1000
    assert (found["wrong"], found["odd"]) == (0, 0)
    # It is listed and measured, and its value is shown.
    page.wait(
        "[...document.querySelectorAll('#tree .leaf')]"
        ".some((each) => each.title === '= d(/w0.phase)')"
    )
    page.wait(
        "document.querySelector('.drawer tbody').textContent.includes('= /w0.wave - /w1.wave')"
    )
    page.wait(
        "[...document.querySelectorAll('.chip b')].every((each) => /[0-9]/.test(each.textContent))"
    )
    # A bookmark contains the derived signal, but not its source.
    page.ask("scope.toggle('/w0.wave')")
    page.wait('decodeURIComponent(location.hash).includes(\'"traces":["= d(/w0.phase)"\')')
    assert page.errors == []


def test_derived_signals_of_a_bookmark_are_shown_and_wrong_ones_are_named(visit: Opener) -> None:
    page = visit('{"panes":[{"traces":["= low(/w0.wave, 5)","= lo(/w0.wave)","= /w0.wave +"]}]}')
    page.wait("!!(scope.live.column('= low(/w0.wave, 5)'))")
    assert page.ask("scope.traces().map((each) => each.name)") == ["= low(/w0.wave, 5)"]
    told = page.ask("document.getElementById('error').textContent")
    assert told.startswith('left out: = lo(/w0.wave): "lo" is none of the functions d, diff,')
    assert told.endswith("= /w0.wave +: it ends too early")
    assert page.errors == []


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", ""),
        ("1 + 2", "= 1 + 2: it has no signal, such as /wave.wave"),
        ("d /w0.wave", "= d /w0.wave: the arguments of d stand in parentheses"),
        ("low(/w0.wave)", "= low(/w0.wave): low has 2 arguments, not 1"),
        ("low(/w0.wave, -3)", "= low(/w0.wave, -3): low needs a frequency above 0 Hz, not -3"),
        (
            "high(/w0.wave, 2 - 2)",
            "= high(/w0.wave, 2 - 2): high needs a frequency above 0 Hz, not 2 - 2",
        ),
        ("(/w0.wave", '= (/w0.wave: ")" is missing after "(/w0.wave"'),
        ("/w0.wave)", '= /w0.wave): ")" is not expected after "/w0.wave"'),
        ("/w0", '= /w0: "/w0" is no signal: a signal is named as /wave.wave'),
        ("/w0.wave ? 1", '= /w0.wave ? 1: "?" is not expected after "/w0.wave"'),
        ("(" * 400 + "/w0.wave", None),
        ("/w0.wave" + " + 1" * 300, None),
        ("constructor(/w0.wave)", None),
        ("</b>", None),
    ],
)
def test_an_invalid_expression_is_reported_in_one_line(
    visit: Opener, text: str, error: str | None
) -> None:
    page = visit()
    page.wait("scope.rate")
    _derive(page, text)
    told = page.ask("document.querySelector('#derive output').textContent")
    if error is None:
        assert told and "\n" not in told and len(told) < 300
    else:
        assert told == error
    assert page.ask("scope.traces().length") == 0
    assert page.errors == []


def test_functions_of_known_values_are_right(visit: Opener) -> None:
    page = visit()
    page.wait("!!window.scope")
    found = page.ask(
        """(async () => {
          const { Store } = await import("/page/data/store.js");
          const count = 4000, rate = 1000;
          const made = (f) => Float64Array.from({ length: count }, (_, i) => f(i / rate));
          const store = Store.of({
            kind: 2, count, lost: 0,
            times: made((t) => t), cycles: made((t) => Math.round(t * rate)),
            latencies: made(() => 3), durations: made(() => 0),
            traces: [made((t) => Math.sin(2 * Math.PI * t)), made((t) => (t < 1 ? 0 : 1))],
          }, ["/a.x", "/a.y"]);
          const last = (name) => store.column(name).get(count - 1);
          const at = (name, time) => store.column(name).get(store.find(time));
          return {
            arithmetic: last("= 2 * (3 + 1) ^ 2 / 4 - -1 + 0 * /a.x"),
            power: last("=2^3^2+0*/a.x"), minus: last("= -2^2 + 0*/a.x"),
            divided: last("=/a.y/ /a.y"), cycle: last("= latency + 0 * /a.x"),
            slope: at("= d(/a.x) / (2 * 3.141592653589793)", 2),
            twice: at("= d(d(/a.x))", 1.25), sum: at("= integral(/a.x)", 0.5),
            low: at("= low(/a.y, 1)", 1 + 1 / (2 * Math.PI)),
            high: at("= high(/a.y, 1)", 1 + 1 / (2 * Math.PI)),
            most: last("= max(abs(/a.x), 5)"),
            begin: [0, 1].every((place) => store.column("= d(d(/a.x))").isBlank(place)),
            gone: store.column("= d(/a.x) + /a.z") === undefined,
          };
        })()"""
    )
    turn = 2 * math.pi
    assert (found["arithmetic"], found["power"], found["minus"]) == (9, 512, -4)
    assert (found["divided"], found["cycle"], found["most"]) == (1, 3, 5)
    assert found["slope"] == pytest.approx(1, abs=1e-3)
    assert found["twice"] == pytest.approx(-turn * turn, rel=1e-3)
    assert found["sum"] == pytest.approx(2 / turn, rel=1e-2)
    # A step reaches 1 - 1/e of its height after the time constant.
    assert found["low"] == pytest.approx(1 - 1 / math.e, abs=0.01)
    assert found["high"] == pytest.approx(1 / math.e, abs=0.01)
    assert found["begin"] and found["gone"]


def test_a_derived_signal_starts_again_where_cycles_are_missing(visit: Opener) -> None:
    page = visit()
    page.wait("!!window.scope")
    found = page.ask(
        """(async () => {
          const { Store } = await import("/page/data/store.js");
          const store = new Store(8192), zeros = new Float64Array(10);
          const batch = (first, lost) => {
            const cycles = Float64Array.from({ length: 10 }, (_, i) => first + i);
            return { count: 10, lost, cycles, times: cycles.map((each) => each / 1000),
              latencies: zeros, durations: zeros, traces: [cycles.map((each) => 2 * each)] };
          };
          store.push(batch(0, 0), ["/a.x"]);
          const column = store.column("= diff(/a.x)");
          store.push(batch(10, 0), ["/a.x"]);
          store.push(batch(100, 80), ["/a.x"]);
          store.push({ ...batch(110, 0), traces: [] }, []);
          store.push(batch(120, 0), ["/a.x"]);
          const told = [];
          for (let at = store.begin; at < store.end; at++)
            told.push(column.isOdd(at) ? "odd" : column.isBlank(at) ? "blank" : column.get(at));
          return told;
        })()"""
    )
    twos = [2] * 9
    # The first cycle, the gap, the cycle after it, and cycles without the signal have no value.
    assert found == [
        "blank", *twos, *[2] * 10, "blank", "blank", *twos, *["blank"] * 10, "blank", *twos,
    ]  # fmt: skip


def test_one_signal_is_drawn_over_another(visit: Opener) -> None:
    page = visit(
        '{"panes":[{"traces":["/w0.wave","= d(/w0.wave)","/w1.wave"]}],"span":2,"drawer":"xy",'
        '"xy":{"x":"/w0.wave","y":"= d(/w0.wave)"}}'
    )
    page.wait("scope.live.end > 2500")
    chosen = "[...document.querySelectorAll('[data-drawer=xy] select')].map((each) => each.value)"
    assert page.wait(f"{chosen}.every(Boolean) && {chosen}") == ["/w0.wave", "= d(/w0.wave)"]
    # A sine over its slope is an ellipse: something at its four ends, nothing in its middle.
    drawn = """(() => {
      const canvas = document.querySelector('[data-drawer=xy] canvas'), g = canvas.getContext('2d');
      const area = [64, 8, canvas.width - 76, canvas.height - 30];
      const { data } = g.getImageData(...area), isInk = (x, y) => {
        const at = 4 * (Math.round(y) * area[2] + Math.round(x));
        const [red, green, blue] = data.slice(at, at + 3);
        return Math.max(red, green, blue) - Math.min(red, green, blue) > 60;
      };
      const near = (x, y) => {
        for (let dx = -4; dx < 5; dx++)
          for (let dy = -4; dy < 5; dy++) if (isInk(x + dx, y + dy)) return true;
        return false;
      };
      const [w, h] = area.slice(2), pad = 0.05 / 1.1;
      const ends = [pad, 1 - pad].flatMap((part) => [near(w * part, h / 2), near(w / 2, h * part)]);
      return { ends, middle: near(w / 2, h / 2) };
    })()"""
    page.wait(f"{drawn}.ends.every(Boolean) && !{drawn}.middle")
    page.ask("document.querySelector('[data-drawer=xy] [name=swap]').click()")
    assert page.ask(chosen) == ["= d(/w0.wave)", "/w0.wave"]
    page.wait('decodeURIComponent(location.hash).includes(\'"xy":{"x":"= d(/w0.wave)"\')')
    assert page.errors == []


def test_a_trigger_is_offered_no_derived_signal(visit: Opener) -> None:
    page = visit('{"panes":[{"traces":["= d(/w0.wave)","/w1.wave"]}],"mode":"trigger"}')
    page.wait("scope.mode === 'trigger' && scope.catalog.length > 2")
    offered = page.ask(
        "[...document.querySelector('#trigger [name=signal]').options].map((each) => each.value)"
    )
    assert "/w1.wave" in offered
    assert not any(each.startswith("=") for each in offered)
    # A shot has the derived signal of its cycles.
    page.ask("document.querySelector('#trigger [name=low]').value = '-1e9'")
    page.ask(
        "const kind = document.querySelector('#trigger [name=kind]');"
        "kind.value = 'level'; kind.onchange()"
    )
    page.ask("document.querySelector('#trigger [name=arm]').click()")
    page.wait("!!(scope.shot && scope.store.column('= d(/w0.wave)'))")
    assert page.ask("Number.isFinite(scope.store.column('= d(/w0.wave)').get(scope.store.end - 1))")
    assert page.errors == []
