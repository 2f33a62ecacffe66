"""The scope's page in a browser, with a real loop."""

import math
import re
from collections.abc import Iterator

import pytest
import rtcf
from browser import Page
from daemon_process import Daemon, wait_for
from rtcf_shared import spec
from scope_pages import Opener
from scope_process import ScopeProcess, looping

_WAVES = 8


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop of 2 kHz with sixteen changing numbers."""
    components = [
        rtcf.component("rtcf_examples", "Wave", name=f"w{i}", parameters=[f"rate:={i + 1}.0"])
        for i in range(_WAVES)
    ]
    with looping(tmp_path_factory.mktemp("loop"), components, 2000.0) as daemon:
        yield daemon


@pytest.fixture(scope="module")
def scope(loop: Daemon) -> Iterator[ScopeProcess]:
    with ScopeProcess(loop, "--right", "tune") as scope:
        yield scope


def _amplitude(client: rtcf.Client) -> float:
    parameters = client.get_component("w1").parameters
    return float(next(p.value.double_value for p in parameters if p.name == "amplitude"))


def _press(page: Page, element: str) -> None:
    page.ask(f"document.querySelector({element!r}).click()")


def _choose_runner(page: Page, runner: str) -> None:
    select = "document.getElementById('runner')"
    page.ask(f"{select}.value = {runner!r}; {select}.onchange()")


def test_a_frozen_view_stays_while_the_loop_continues(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w0.wave"]}],"span":1}')
    page.wait("scope.live.end > 2500")
    page.ask("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: ' ', bubbles: true}))")
    end = page.ask("scope.view.end")
    page.wait("scope.live.lastTime > scope.view.end + 1")
    assert page.ask("scope.view.end") == end
    assert page.wait("document.getElementById('freeze').textContent === 'Run'")
    # The frozen span has the full rate, and can be measured.
    page.ask("scope.setCursor('a', scope.view.end - 1); scope.setCursor('b', scope.view.end)")
    page.wait("document.querySelector('caption').textContent.startsWith('between the cursors')")
    page.wait("document.querySelector('.drawer tbody').textContent.includes('/w0.wave')")


def test_a_trigger_on_one_cycle_shows_it_in_the_middle(visit: Opener, scope: ScopeProcess) -> None:
    # A phase of 1 Hz falls in one of 2000 cycles.
    page = visit(
        scope,
        '{"panes":[{"traces":["/w0.phase"]}],"mode":"trigger","trigger":{"signal":"/w0.phase",'
        '"kind":"edge","slope":"falling","low":0.5,"high":1,"window":100,"position":50,'
        '"holdoff":0,"single":false}}',
    )  # fmt: skip
    page.wait("scope.mode === 'trigger' && scope.rate === 2000")
    page.wait("document.querySelector('#trigger [name=signal]').value === '/w0.phase'")
    _press(page, "#trigger [name=arm]")
    # The first may come before the scope has received all cycles that it shows.
    page.wait("scope.shots.length > 1")
    shot = page.ask(
        """(() => {
          const { store, cycle } = scope.shot, { view } = scope;
          const phase = store.column("/w0.phase"), found = [];
          for (let at = store.begin + 1; at < store.end; at++)
            if (phase.get(at) < phase.get(at - 1))
              found.push([at, store.time(at), store.cycle(at) === cycle]);
          return { found, count: store.end - store.begin, begin: view.begin, end: view.end };
        })()"""
    )
    assert shot["found"] == [[100, 0, True]]
    assert shot["count"] == 200
    # The same number of cycles on both sides; a busy machine drops some, whose time counts, too.
    assert abs(shot["begin"] + shot["end"]) < 0.2 * (shot["end"] - shot["begin"])
    assert page.errors == []


_TRIGGER = (
    '{{"panes":[{{"traces":["/w0.phase"]}}],"mode":"trigger","trigger":{{"signal":"{}",'
    '"kind":"level","slope":"above","low":{},"window":20,"position":50,"holdoff":0,"single":true}}}}'
)
_SIGNAL = "document.querySelector('#trigger [name=signal]')"
_SAID = "document.querySelector('#trigger [name=state]').textContent"


def test_the_level_of_a_trigger_can_be_dragged(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(
        scope,
        '{"panes":[{"traces":["/w0.wave"],"scale":{"low":-2,"high":2}}],"mode":"trigger",'
        '"trigger":{"signal":"/w0.wave","kind":"edge","slope":"rising","low":0,"window":100}}',
    )  # fmt: skip
    page.wait("scope.rate === 2000 && scope.units.has('/w0.wave')")
    _press(page, "#trigger [name=arm]")
    page.wait("scope.shots.length > 0 && document.querySelectorAll('.handle').length === 1")
    left, top, width, height = page.ask(
        "(({ left, top, width, height }) => [left, top, width, height])"
        "(scope.panes[0].plot.getBoundingClientRect())"
    )
    x = left + width / 2
    ways = [("mousePressed", 0.5), ("mouseMoved", 0.4), ("mouseMoved", 0.375)]
    for kind, share in [*ways, ("mouseReleased", 0.375)]:
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=top + share * height, button="left",
                  buttons=1, clickCount=1)  # fmt: skip
    page.wait("scope.trigger.settings.low > 0.4 && scope.trigger.settings.low < 0.6")
    page.wait("Number(document.querySelector('#trigger [name=low]').value) > 0.4")
    # The trigger is armed again with the new level; the drag neither panned nor set a cursor.
    count = page.ask("scope.shots.length")
    page.wait(f"scope.shots.length > {count}")
    last = page.ask(
        "(({ store }) => store.column('/w0.wave').get(store.nearest(0)))(scope.shots.at(-1))"
    )
    assert last == pytest.approx(page.ask("scope.trigger.settings.low"), abs=0.01)
    assert page.ask("scope.cursors.a") is None
    assert page.errors == []


def test_an_automatic_trigger_shows_the_newest_cycles_without_a_hit(
    visit: Opener, scope: ScopeProcess
) -> None:
    page = visit(
        scope,
        '{"panes":[{"traces":["/w0.wave"]}],"mode":"trigger","trigger":{"signal":"/w0.wave",'
        '"kind":"edge","slope":"rising","low":1e9,"window":200,"position":50,"auto":true}}',
    )
    page.wait("scope.rate === 2000 && scope.live.end > 1000")
    _press(page, "#trigger [name=arm]")
    page.wait("scope.shot?.isPreview")
    first = page.ask("scope.shot.cycle")
    page.wait(f"scope.shot.cycle > {first}")
    assert page.ask(_SAID) == "no hit: the newest cycles"
    found = page.ask(
        "[scope.store.end - scope.store.begin, scope.store.firstTime, scope.view.span]"
    )
    assert found == [pytest.approx(400, abs=2), pytest.approx(-0.1, abs=2e-3), pytest.approx(0.2)]
    assert page.ask("scope.shots.length") == 0
    # A hit takes the place of the newest cycles.
    page.ask("scope.onLevel('low', 0)")
    page.wait("scope.shots.length > 0 && !scope.shot.isPreview")
    assert page.ask(_SAID).startswith("hit at cycle ")
    assert page.errors == []


def test_a_bookmarked_trigger_is_armed_on_its_signal(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, _TRIGGER.format("/w3.wave", 1e9))
    # Before the page has the list of signals, and after.
    for known in ("", "&& scope.catalog.length > 2"):
        page.wait(f"scope.mode === 'trigger' {known}")
        _press(page, "#trigger [name=arm]")
        page.wait("scope.trigger.state === 'armed'")
        assert page.ask("scope.trigger.armed") == ["/w3.wave"]
        assert page.ask(f"{_SIGNAL}.value") == "/w3.wave"
        _press(page, "#trigger [name=arm]")
        page.wait("scope.trigger.state === 'off'")
    _press(page, "#roll")
    _press(page, "#triggered")
    assert page.ask(f"{_SIGNAL}.value") == "/w3.wave"
    assert page.errors == []


def test_a_trigger_on_a_removed_signal_reports_it_and_arms_no_other(
    visit: Opener, scope: ScopeProcess
) -> None:
    page = visit(scope, _TRIGGER.format("/gone.wave", -1e9))
    page.wait("scope.mode === 'trigger' && scope.catalog.length > 2")
    assert page.ask(f"{_SIGNAL}.value") == "/gone.wave"
    assert page.ask(f"{_SIGNAL}.selectedOptions[0].text") == "/gone.wave (not there)"
    _press(page, "#trigger [name=arm]")
    page.wait(f"{_SAID} === 'waiting for /gone.wave: not there'")
    assert page.ask("scope.trigger.armed") == ["/gone.wave"]
    assert page.ask("document.getElementById('error').textContent") == (
        "the trigger waits until its signals exist: /gone.wave"
    )
    # The user selects another signal: the trigger is armed, and hits.
    page.ask(f"{_SIGNAL}.value = '/w2.wave'; {_SIGNAL}.onchange()")
    page.wait("scope.trigger.state === 'done' && scope.shot")
    page.wait("document.getElementById('error').hidden")
    assert page.errors == []


def test_a_new_layout_or_runner_disarms_the_trigger(
    visit: Opener, scope: ScopeProcess, loop: Daemon
) -> None:
    page = visit(scope, _TRIGGER.format("/w3.wave", 1e9))
    page.wait("scope.mode === 'trigger' && scope.catalog.length > 2")
    with rtcf.Client(loop.socket) as client:
        client.add_runner("second")
        client.load(rtcf.component("rtcf_examples", "Wave", name="other"), runner="second")
        try:
            _press(page, "#trigger [name=arm]")
            page.wait("scope.trigger.state === 'armed'")
            page.ask("void document.getElementById('runner').onfocus()")
            page.wait("document.getElementById('runner').options.length === 2")
            _choose_runner(page, "second")
            page.wait("scope.catalog.some((each) => each.name === '/other.wave')")
            assert page.ask("[scope.trigger.state, scope.trigger.armed]") == ["off", []]
            assert page.ask(f"{_SIGNAL}.selectedOptions[0].text") == "/w3.wave (not there)"
            assert page.ask("document.getElementById('error').textContent") == (
                "signals omitted until they exist: /w0.phase"
            )
        finally:
            client.remove_runner("second")
    page.wait("document.getElementById('error').textContent.includes('second')")
    _choose_runner(page, "rt_runner")
    page.wait("document.getElementById('error').hidden && scope.catalog.length > 2")
    _press(page, "#trigger [name=arm]")
    page.wait("scope.trigger.state === 'armed'")
    saved = _TRIGGER.format("/w4.wave", 1e9).replace('"single":true', '"single":false')
    page.ask(f"fetch('/api/layouts/its', {{method: 'PUT', body: {saved!r}, headers: "
             "{Authorization: `Bearer ${localStorage.getItem('session')}`}})")  # fmt: skip
    page.ask("const l = document.getElementById('layouts'); l.append(new Option('its', '=its'));"
             "l.value = '=its'; l.onchange({target: l})")  # fmt: skip
    page.wait(f"{_SIGNAL}.value === '/w4.wave'")
    page.wait("scope.trigger.state === 'off'")
    _press(page, "#trigger [name=arm]")
    page.wait("scope.trigger.state === 'armed' && scope.trigger.armed[0] === '/w4.wave'")
    assert page.errors == []


def test_the_legend_of_a_shot_shows_the_values_at_its_hit(
    visit: Opener, scope: ScopeProcess
) -> None:
    page = visit(scope, _TRIGGER.format("/w0.phase", 0.5))
    page.wait("scope.mode === 'trigger' && scope.rate === 2000")
    _press(page, "#trigger [name=arm]")
    page.wait("scope.shot")
    told = page.ask(
        """(async () => {
          const { figure } = await import("/page/drawing/axes.js");
          const { store } = scope.shot, column = store.column("/w0.phase");
          scope.panes[0].update();
          return [scope.panes[0].traces[0].value.textContent,
            figure(column.get(store.nearest(0)), ""), figure(column.get(store.end - 1), "")];
        })()"""
    )
    assert told[0] == told[1] != told[2]


def test_a_layout_may_have_a_signal_in_several_panes(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(
        scope,
        '{"panes":[{"traces":["/w0.wave"]},{"traces":["/w0.wave"]},{"traces":["/w0.wave","/w1.wave"],'
        '"scale":{"low":-3,"high":3}},{"traces":[]},null,{"traces":"/w2.wave"}],"span":1}',
    )  # fmt: skip
    page.wait("scope.live.end > 100 && scope.live.column('/w1.wave') !== undefined")
    panes = page.ask(
        "scope.panes.map((pane) => [pane.traces.map((each) => each.name), pane.scale])"
    )
    assert panes[:3] == [
        [["/w0.wave"], None], [["/w0.wave"], None],
        [["/w0.wave", "/w1.wave"], {"low": -3, "high": 3}],
    ]  # fmt: skip
    assert page.errors == []


def test_an_invalid_bookmark_opens(visit: Opener, scope: ScopeProcess) -> None:
    for layout in (
        "null", "3", '"x"', "[]", '{"panes":{}}',
        '{"trigger":{"kind":"loud","low":"x"},"mode":"trigger"}',
        '{"panes":[3,{"traces":[{}]}],"trigger":7,"span":"x","drawer":{}}',
    ):  # fmt: skip
        page = visit(scope, layout)
        page.wait("scope.rate && scope.catalog.length > 2")
        assert page.ask("document.getElementById('error').hidden")
        assert page.errors == []


def test_enter_in_the_search_shows_the_first_signal_that_is_found(
    visit: Opener, scope: ScopeProcess
) -> None:
    page = visit(scope)
    page.wait("scope.catalog.length > 10")
    page.ask(
        """(() => {
          const search = document.getElementById("search");
          search.value = "w5 phase";
          search.oninput();
          search.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
        })()"""
    )
    page.wait("scope.traces().map(({ name }) => name).join() === '/w5.phase'")
    assert page.errors == []


def test_a_signal_can_be_dragged_into_a_pane(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w0.wave"]},{"traces":["/w1.wave"]}]}')
    page.wait("scope.panes.length === 2 && scope.catalog.length > 10")
    page.ask(
        """(() => {
          const dataTransfer = new DataTransfer();
          const to = scope.panes[1].face, leaf = document.querySelector('[title="/w2.wave"]');
          const send = (target, kind) => target.dispatchEvent(
            new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true }));
          send(leaf, "dragstart");
          window.accepted = !send(to, "dragover"); // a pane prevents the default: no drop
          window.marked = scope.panes[1].box.classList.contains("target");
          send(to, "drop");
        })()"""
    )
    assert page.ask("[accepted, marked]") == [True, True]
    names = "scope.panes.map((pane) => pane.traces.map(({ name }) => name))"
    assert page.ask(names) == [["/w0.wave"], ["/w1.wave", "/w2.wave"]]
    assert page.ask("document.querySelectorAll('.pane.target').length") == 0
    # Other things that are dragged, such as a file, are not accepted.
    refused = page.ask(
        """scope.panes[1].face.dispatchEvent(new DragEvent("dragover",
          { dataTransfer: new DataTransfer(), bubbles: true, cancelable: true }))"""
    )
    assert refused is True


def test_two_fingers_zoom_time(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w0.wave"]}],"span":8}')
    page.wait("scope.live.end > 1000 && scope.panes[0].size.width > 100")
    page.ask("scope.freeze()")
    left, top, width, height = page.ask(
        "(({ left, top, width, height }) => [left, top, width, height])"
        "(scope.panes[0].plot.getBoundingClientRect())"
    )
    y, middle = top + height / 2, left + width / 2
    at_middle = (
        f"scope.panes[0].timeAt({middle} - scope.panes[0].face.getBoundingClientRect().left)"
    )
    still = page.ask(at_middle)

    def touch(kind: str, half: float | None) -> None:
        points = [] if half is None else [
            {"x": middle - half, "y": y, "id": 1}, {"x": middle + half, "y": y, "id": 2}
        ]  # fmt: skip
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    touch("touchStart", 40)
    for half in (50, 60, 70, 80):
        touch("touchMove", half)
    touch("touchEnd", None)
    assert page.ask("scope.view.span") == pytest.approx(4.0, rel=0.02)
    now = page.ask(at_middle)
    assert now == pytest.approx(still, abs=0.05)
    assert page.ask("scope.cursors.a") is None
    assert page.errors == []


def test_the_time_axis_is_below_the_last_pane_only(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w0.wave"]},{"traces":["/w1.wave"]}]}')
    page.wait("scope.panes.length === 2")
    heights = "scope.panes.map((pane) => pane.face.querySelector('.times').offsetHeight)"
    assert page.ask(heights) == [0, 22]
    page.ask("scope.removePane(scope.panes[1])")
    assert page.ask(heights) == [22]


def test_a_report_shows_the_panes_and_the_measurements(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w0.wave"]}]}')
    page.wait("scope.live.end > 500")
    page.ask(
        "window.print = () => { window.printed = document.getElementById('report').textContent }"
    )
    page.ask(
        "(({ value }) => 0)(Object.assign(document.getElementById('export'), { value: 'report' }));"
        "document.getElementById('export').dispatchEvent(new Event('change'))"
    )
    said = page.wait("window.printed")
    assert said.startswith("rtcf scope: rt_runner") and said.endswith(", 10 s")
    page.call("Emulation.setEmulatedMedia", media="print")
    shown = """((name) => [...document.querySelectorAll(name)].some((e) => e.offsetHeight > 0))"""
    for name, is_there in (
        ("#report", True), (".pane canvas", True), ("[data-drawer=measurements] table", True),
        ("header", False), ("aside", False), ("footer nav", False), (".chip button", False),
    ):  # fmt: skip
        assert page.ask(f"{shown}({name!r})") == is_there, name


def test_escape_ends_the_search(visit: Opener, scope: ScopeProcess) -> None:
    page = visit(scope)
    page.wait("document.querySelectorAll('#tree .leaf').length > 10")
    all_of_them = page.ask("document.querySelectorAll('#tree .leaf').length")
    page.ask("document.getElementById('search').focus()")
    page.call("Input.insertText", text="w3.")
    page.wait("document.querySelectorAll('#tree .leaf').length === 3")
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key="Escape", code="Escape",
                  windowsVirtualKeyCode=27)  # fmt: skip
    assert page.ask("document.getElementById('search').value") == ""
    assert page.ask("document.querySelectorAll('#tree .leaf').length") == all_of_them


def test_cycles_before_a_page_opens_do_not_count_as_dropped(
    visit: Opener, scope: ScopeProcess
) -> None:
    for _ in range(2):
        page = visit(scope, '{"panes":[{"traces":["/w5.wave"]}]}')
        page.wait("scope.live.end > 1000")
        assert page.ask("scope.live.lost") == 0
        assert "not seen" not in page.ask("document.getElementById('counters').textContent")
        page.ask("scope.toggle('/w5.wave')")
        page.wait("scope.traces().length === 0")


def test_events_are_filtered_and_have_milliseconds(
    visit: Opener, scope: ScopeProcess, loop: Daemon
) -> None:
    page = visit(scope)
    page.wait("scope.rate")
    _press(page, "footer [data-drawer=events]")
    listed = "[...document.querySelectorAll('.drawer[data-drawer=events] li')]"
    with rtcf.Client(loop.socket) as client:
        for amplitude in ("9.5", "1.0"):
            client.set_parameters("w6", [spec.parse_parameter(f"amplitude:={amplitude}")])
    page.wait(f"{listed}.length >= 3")
    whole = page.ask(f"{listed}.map((each) => each.textContent)")
    assert all(re.match(r"\d\d?:\d\d:\d\d[.,]\d{3}", each) for each in whole), whole
    assert any("warn" in each for each in whole) and any("parameters" in each for each in whole)
    others = ("faults", "overruns", "changes", "information")
    for kind in others:
        _press(page, f"[data-kind={kind}]")
    page.wait(f"{listed}.length && {listed}.every((each) => each.textContent.includes('warn'))")
    for kind in others:
        _press(page, f"[data-kind={kind}]")
    page.ask(
        "const f = document.querySelector('[aria-label=\"filter events\"]');"
        "f.value = 'parameters W6'; f.oninput()"
    )
    page.wait(
        f"{listed}.length && {listed}.every((each) => each.textContent.includes('parameters'))"
    )
    assert page.errors == []


def test_a_slider_sets_the_parameter_of_the_running_component(
    visit: Opener, scope: ScopeProcess, loop: Daemon
) -> None:
    page = visit(scope)
    page.wait("scope.rate")
    _press(page, "aside [data-tab=parameters]")
    page.wait("document.querySelector('[data-slider=\"/w1.amplitude\"]') !== null")
    with rtcf.Client(loop.socket) as client:
        before = _amplitude(client)
    page.ask(
        """(() => {
          const slider = document.querySelector('[data-slider="/w1.amplitude"]');
          for (const value of [2, 3, 1.5]) {
            slider.value = value;
            slider.dispatchEvent(new Event("input", { bubbles: true }));
          }
          slider.dispatchEvent(new Event("change", { bubbles: true }));
        })()"""
    )
    with rtcf.Client(loop.socket) as client:
        wait_for(lambda: _amplitude(client) == 1.5, "the slider's value in the loop")
        # Dragging is a preview; only its end is a change.
        changes = [each for each in client.get_history("w1", "amplitude") if each.how != "load"]
        assert [each.value.double_value for each in changes] == [1.5]
        undo = "[...document.querySelectorAll('#parameters > button')]"
        page.wait(f"{undo}.some((each) => !each.hidden && each.textContent.includes('back to'))")
        page.ask(f"{undo}[0].click()")
        wait_for(lambda: _amplitude(client) == before, "the value before")
        page.wait(f"{undo}[0].hidden")
    # The page names the user, and follows changes by others.
    page.wait("document.querySelector('[data-who=\"/w1.amplitude\"]').textContent")
    with rtcf.Client(loop.socket) as client:
        client.set_parameters("w1", [spec.parse_parameter("amplitude:=0.5")])
    page.wait("document.querySelector('[data-key=\"/w1.amplitude\"]').value === '0.5'")
    assert page.errors == []


def test_a_log_record_is_a_mark_at_its_cycle(
    visit: Opener, scope: ScopeProcess, loop: Daemon
) -> None:
    page = visit(scope, '{"panes":[{"traces":["/w7.wave"]}]}')
    page.wait("scope.rate && !scope.live.empty")
    _press(page, "footer [data-drawer=events]")
    with rtcf.Client(loop.socket) as client:
        client.set_parameters("w7", [spec.parse_parameter("amplitude:=9.5")])
        page.wait(
            "document.querySelector('.drawer[data-drawer=events]').textContent"
            ".includes('/w7: amplitude 9.5 is large')"
        )
        client.set_parameters("w7", [spec.parse_parameter("amplitude:=1.0")])
    # Near the time of the newest values.
    assert page.ask(
        """(() => {
          const mark = scope.marks().find((each) => each.event.what === "warn");
          return mark && Math.abs(mark.time - scope.live.lastTime) < 60;
        })()"""
    )
    assert page.errors == []


def test_measurements_and_spectra_of_known_values_are_right(
    visit: Opener, scope: ScopeProcess
) -> None:
    page = visit(scope)
    page.wait("scope.rate")
    found = page.ask(
        """(async () => {
          const m = await import("/page/data/measure.js"), f = await import("/page/data/fft.js");
          const rate = 1000, times = Array.from({ length: 4096 }, (_, i) => i / rate);
          const sine = times.map((t) => 3 * Math.sin(2 * Math.PI * 125 * t) + 1);
          const { amplitudes, step } = f.spectrum(sine, rate);
          const peak = amplitudes.indexOf(Math.max(...amplitudes));
          const response = times.map((t) => t < 1 ? 0 : 1 - Math.exp(-(t - 1) / 0.1));
          const wild = response.map((r, i) =>
            1 - (1 - r) * Math.cos(40 * Math.max(times[i] - 1, 0)));
          return { hertz: peak * step, size: amplitudes[peak],
            frequency: m.frequency(times, sine, -2, 4), step: m.step(times, response),
            wild: m.step(times, wild), none: m.step(times, sine) };
        })()"""
    )
    assert found["hertz"] == 125.0
    assert math.isclose(found["size"], 3.0, rel_tol=1e-6)
    assert math.isclose(found["frequency"], 125.0, rel_tol=1e-6)
    # For a first-order system with 0.1 s: ln 9 and ln 50 times that.
    assert abs(found["step"]["rise"] - 0.1 * math.log(9)) < 2e-3
    assert found["step"]["overshoot"] < 1e-6
    assert abs(found["step"]["settling"] - 0.1 * math.log(50)) < 2e-3
    assert found["wild"]["overshoot"] > 30
    assert found["none"]["rise"] is None or math.isnan(found["none"]["rise"])
