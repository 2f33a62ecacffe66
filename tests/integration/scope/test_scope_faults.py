"""The scope's page after a fault: the reason, the last cycles and the incident."""

from collections.abc import Iterator

import pytest
import rtcf
from browser import Browser, Page
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf_shared.graph_reader import read_graphs
from scope_pages import Opener
from scope_process import ScopeProcess

ARM = BUILD_TREE / "devel" / "share" / "rtcf_arm"
SAYS = "update() threw: the encoder jumped"
BANNER = "document.getElementById('fault')"


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Yield a browser with WebGL."""
    with Browser(tmp_path_factory.mktemp("browser"), webgl=True) as browser:
        yield browser


@pytest.fixture
def scope(daemon: Daemon) -> Iterator[ScopeProcess]:
    """Yield a read-only scope of a daemon."""
    with ScopeProcess(daemon) as scope:
        yield scope


@pytest.fixture
def wave(client: rtcf.Client) -> None:
    """Run a loop that has not failed yet."""
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    client.start()


def fail(client: rtcf.Client) -> str:
    """Let the loop fail; return the name of the incident."""
    client.load(rtcf.component("rtcf_faults", "Throws", name="bad"))
    wait_for(lambda: client.list_incidents(), "an incident")
    (found,) = client.list_incidents()
    return found.name


def listed(page: Page) -> list[str]:
    """Return the events in the drawer."""
    page.ask("document.querySelector('footer [data-drawer=events]').click()")
    found: list[str] = page.ask(
        "[...document.querySelectorAll('.drawer[data-drawer=events] li')].map((e) => e.textContent)"
    )
    return found


def test_a_fault_is_told_with_component_reason_and_cycle(
    visit: Opener, scope: ScopeProcess, client: rtcf.Client, wave: None
) -> None:
    page = visit(scope)
    page.wait("window.scope && scope.units.has('/wave.wave')")
    page.ask("scope.toggle('/wave.wave')")
    page.wait("scope.live.end > 2000 && scope.rate")
    assert page.ask(f"{BANNER}.hidden")
    fail(client)
    page.wait(f"!{BANNER}.hidden")
    (status,) = client.list_runners()
    cycle = status.status.partition("iteration ")[2].partition(":")[0]
    assert (
        page.ask(f"{BANNER}.querySelector('b').textContent") == f"The loop ended in cycle {cycle}"
    )
    assert page.ask(f"{BANNER}.querySelector('span').textContent") == f"/bad: {SAYS}"
    # The panes still show the last second.
    page.wait("scope.view.end - scope.live.lastTime < 0.2")
    assert page.ask("scope.live.cycle(scope.live.end - 1)") == pytest.approx(int(cycle), abs=1)
    # It can be hidden, and a start hides it.
    page.ask(f"{BANNER}.querySelector('[name=dismiss]').click()")
    assert page.ask(f"{BANNER}.hidden")
    client.unload(["bad"])
    client.start()
    page.wait("document.getElementById('state').className === 'running'")
    client.load(rtcf.component("rtcf_faults", "Throws", name="worse"))
    page.wait(f"!{BANNER}.hidden && {BANNER}.textContent.includes('/worse: {SAYS}')")
    assert page.errors == []


def test_an_incident_shows_its_own_events_and_the_component_that_failed(
    visit: Opener, scope: ScopeProcess, client: rtcf.Client, wave: None
) -> None:
    name = fail(client)
    client.unload(["bad"])
    client.start()
    client.stop()
    page = visit(scope)  # opened after the fault
    page.wait("document.getElementById('state')?.textContent")
    page.ask("document.querySelector('aside [data-tab=recordings]').click()")
    button = (
        f"[...document.querySelectorAll('#recordings button')]"
        f".find((each) => each.title.includes('{SAYS}'))"
    )
    page.wait(f"{button} !== undefined")
    assert page.ask(f"{button}.textContent") == name
    page.ask(f"{button}.click()")
    page.wait("scope.mode === 'recording'")
    assert page.ask("scope.traces().map((each) => each.name)") == ["/bad.out"]
    assert page.ask("scope.view.span") < 1.1
    found = listed(page)
    assert "loop fault" in found[0] and SAYS in found[0]
    assert any("/bad loaded" in each for each in found)
    # What happened after it is not listed; a time leads to its place in the incident.
    assert not any("unloaded" in each or "stopped by" in each for each in found)
    page.ask("document.querySelector('.drawer[data-drawer=events] li button').click()")
    assert page.ask("scope.mode") == "recording"
    assert page.ask("scope.marks().length") == len(found)
    page.ask("document.getElementById('roll').click()")
    assert page.ask("scope.mode") == "roll"
    assert page.errors == []


def test_a_page_that_is_opened_after_a_fault_tells_it_and_invents_no_position(
    visit: Opener, scope: ScopeProcess, daemon: Daemon, client: rtcf.Client
) -> None:
    (graph,) = read_graphs((ARM / "arm.yaml").read_text(), "arm.yaml")
    client.apply(graph.components, settings=graph.settings)
    client.start()
    name = fail(client)
    page = visit(scope)
    page.wait(f"{BANNER}?.hidden === false")
    page.wait("robot.frames && robot.loads")
    assert page.ask("robot.says.textContent") == "position unknown: its joints have no values"
    opacity = "[...robot.links.values()].flatMap(({ solids }) => solids)[0].material.opacity"
    assert page.ask(opacity) < 0.2
    page.ask(f"{BANNER}.querySelector('[name=incident]').click()")
    page.wait("scope.mode === 'recording'")
    assert page.ask("scope.recordings[0].name") == name
    # The robot stands where it was.
    page.wait(f"robot.says.textContent === '' && {opacity} === 1")
    shown = page.ask("robot.list.textContent")
    assert "°" in shown and "\N{EN DASH}" not in shown
    assert page.errors == []


def test_an_incident_that_is_not_there_is_an_error(scope: ScopeProcess, wave: None) -> None:
    status, said = scope.ask("/api/recordings/20200101-000000-rt_runner")
    assert status == 400
    assert b"no recording 20200101-000000-rt_runner: start the scope with this file" in said
