"""The robot in 3-D on the scope's page, moved by a real loop."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from browser import Browser, Page
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf_shared.graph_reader import read_graphs
from scope_pages import Opener
from scope_process import ScopeProcess

ARM = BUILD_TREE / "devel" / "share" / "rtcf_arm"


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Yield a browser with WebGL."""
    with Browser(tmp_path_factory.mktemp("browser"), webgl=True) as browser:
        yield browser


@pytest.fixture
def arm(daemon: Daemon, client: rtcf.Client) -> Daemon:
    """Return `daemon` with the stopped arm."""
    (graph,) = read_graphs((ARM / "arm.yaml").read_text(), "arm.yaml")
    client.apply(graph.components, settings=graph.settings)
    return daemon


def opened(visit: Opener, scope: ScopeProcess, layout: str = "") -> Page:
    """Return a page that shows the robot."""
    page = visit(scope, layout)
    page.wait("document.getElementById('state').textContent")
    # The page opens the robot itself where it finds one; a click would close it again.
    page.ask("robot.isOpen || document.getElementById('robots').click()")
    return page


def angle(page: Page, joint: str) -> float:
    """Return the shown angle of a joint, degrees."""
    text: str = page.ask(
        f"[...robot.list.children].find((each) => each.textContent.includes('{joint}'))"
        ".querySelector('span').textContent"
    )
    return float(text.removesuffix("°"))


def hand(page: Page) -> list[float]:
    """Return the place of the hand in the scene, m."""
    found: list[float] = page.ask(
        "(() => { robot.scene.updateMatrixWorld(true);"
        " return new robot.three.Vector3().setFromMatrixPosition("
        "robot.links.get('hand').group.matrixWorld).toArray(); })()"
    )
    return found


def test_the_robot_moves_with_the_loop_and_shows_its_target(
    visit: Opener, arm: Daemon, client: rtcf.Client
) -> None:
    with ScopeProcess(arm) as scope:
        page = opened(visit, scope)
        client.start()
        page.wait("robot.joints.length === 8 && robot.frames > 0")
        assert page.ask("robot.links.get('upper_arm').parent") == "shoulder"
        # The keyframe "ready": the hand is in front, above the table.
        page.wait("Math.abs(robot.links.get('hand').group.rotation.x) < 1")
        x, y, z = hand(page)
        assert (x, y, z) == pytest.approx((0.39, 0.0, 0.47), abs=0.05)
        client.set_parameters("operator", [rtcf.parse_parameter("mode:=sliders")])
        client.set_parameters("operator", [rtcf.parse_parameter("joint1:=1.2")])
        page.wait(
            "robot.links.get('base') && [...robot.links.values()].some(({ghost}) => ghost.visible)"
        )
        wait_for(lambda: abs(angle(page, "joint1") - 68.8) < 1.0, "the joint at its target")
        x, y, _ = hand(page)
        assert y > 2.0 * x > 0.0, "the arm has turned to the left"
        assert page.errors == []


def test_a_robot_without_values_is_drawn_and_moves_once_they_come(
    visit: Opener, arm: Daemon, client: rtcf.Client
) -> None:
    with ScopeProcess(arm) as scope:
        page = opened(visit, scope)
        page.wait("robot.loads > 0 && robot.frames > 0")
        texts = "[...robot.list.querySelectorAll('span')].map(({textContent}) => textContent)"
        assert page.ask(texts) == ["\u2013"] * 8
        client.start()
        page.wait("robot.list.textContent.includes('71.0°')")
        assert page.errors == []


def test_a_page_opens_with_the_traces_and_the_space_that_the_robots_package_names(
    visit: Opener, arm: Daemon, client: rtcf.Client
) -> None:
    client.start()
    client.set_parameters("operator", [rtcf.parse_parameter("mode:=tour")])
    with ScopeProcess(arm) as scope:
        page = visit(scope)
        page.wait("scope.panes.length === 3 && robot.frames > 20")
        names = page.ask("scope.panes.map((pane) => pane.traces.map(({ name }) => name))")
        joints = [f"joint{i}" for i in range(1, 7)]
        assert names == [
            [f"/robot.{each}_position" for each in joints],
            [f"/{each}/position.error" for each in joints],
            [f"/robot.{each}_effort" for each in joints],
        ]
        # Of the list, only the cycles are unfolded.
        page.wait("document.querySelectorAll('#tree details').length > 20")
        unfolded = (
            "[...document.querySelectorAll('#tree details[open]')].map((e) => e.dataset.name)"
        )
        assert page.ask(unfolded) == ["cycles"]
        # The camera sees the robot, the table and the block during a whole tour.
        outside = """(() => {
          const { Box3, Vector3 } = robot.three, found = [];
          robot.scene.updateMatrixWorld(true);
          const solids = [...robot.links.values()].flatMap((link) => link.solids);
          for (const object of [...solids, ...robot.bodies.map(({ group }) => group)]) {
            const { min, max } = new Box3().setFromObject(object);
            for (const x of [min.x, max.x]) for (const y of [min.y, max.y])
              for (const z of [min.z, max.z]) {
                const at = new Vector3(x, y, z).project(robot.camera);
                if (Math.abs(at.x) > 1 || Math.abs(at.y) > 1) found.push([x, y, z]);
              }
          }
          return found;
        })()"""
        assert page.ask("robot.bodies.map(({ group }) => group.visible)") == [True, True]
        for _ in range(40):
            assert page.ask(outside) == []
            time.sleep(0.25)
        assert page.errors == []


def test_the_block_is_where_the_simulation_has_it(
    visit: Opener, arm: Daemon, client: rtcf.Client
) -> None:
    client.start()
    with ScopeProcess(arm) as scope:
        page = visit(scope)
        page.wait("robot.frames > 5 && robot.bodies[1].group.visible")
        found = page.ask("robot.bodies[1].group.position.toArray()")
        assert found == pytest.approx([0.45, 0.12, 0.22], abs=0.002)
        # A target within a degree of the position is not drawn: it would only flicker.
        page.wait("robot.joints.every((each) => !each.target) ||"
                  " [...robot.links.values()].every(({ ghost }) => !ghost.parent || !ghost.visible"
                  " || ghost.parent !== robot.scene)")  # fmt: skip


def test_a_picked_joint_shows_its_signals(visit: Opener, arm: Daemon, client: rtcf.Client) -> None:
    with ScopeProcess(arm) as scope:
        page = opened(visit, scope, "{}")
        client.start()
        page.wait("robot.joints.length === 8 && robot.frames > 0")
        # On the canvas: a place at which the upper arm is drawn.
        place = page.ask(
            """(() => {
              const { Vector3 } = robot.three, link = robot.links.get('upper_arm').group;
              const at = new Vector3(0, 0, 0.18).applyMatrix4(link.matrixWorld);
              at.project(robot.camera);
              const { x, y, width, height } = robot.canvas.getBoundingClientRect();
              return [x + (at.x + 1) / 2 * width, y + (1 - at.y) / 2 * height];
            })()"""
        )
        for kind in ("mousePressed", "mouseReleased"):
            page.call("Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1], button="left",
                      clickCount=1)  # fmt: skip
        names = ["/robot.joint2_effort", "/robot.joint2_position", "/robot.joint2_velocity",
                 "/setpoints.position2"]  # fmt: skip
        page.wait("scope.traces().length === 4")
        assert page.ask("scope.traces().map(({name}) => name)") == names
        assert page.ask("robot.picked") == "joint2"


def test_a_frozen_page_keeps_the_robot_still(
    visit: Opener, arm: Daemon, client: rtcf.Client
) -> None:
    with ScopeProcess(arm) as scope:
        page = opened(visit, scope)
        client.start()
        client.set_parameters("operator", [rtcf.parse_parameter("mode:=tour")])
        page.wait("robot.frames > 20")
        page.ask("document.getElementById('freeze').click()")
        frozen = page.ask(
            "new Promise((done) => requestAnimationFrame(() =>"
            " requestAnimationFrame(() => done(robot.drawn))))"
        )
        count = page.ask("scope.live.end")
        page.wait(f"scope.live.end > {count} + 2000")
        assert page.ask("robot.drawn") == frozen
        page.ask("document.getElementById('freeze').click()")
        page.wait(f"robot.drawn !== {frozen!r}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no robot: give a component the path of a URDF, or start the scope with --robot FILE"),
        ("<robot", "unclosed token"),
        ("<robot><link name='a'/></robot>", ""),
    ],
)
def test_a_robot_that_cannot_be_shown_is_explained(
    visit: Opener, running: Daemon, tmp_path: Path, text: str, said: str
) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    options = ("--robot", str(file)) if text else ()
    with ScopeProcess(running, *options) as scope:
        page = opened(visit, scope)
        page.wait("robot.loads > 0")
        shown: str = page.ask("robot.says.textContent")
        assert said in shown
        assert bool(said) == bool(shown)


def test_a_file_that_is_missing_is_rejected_at_the_start(running: Daemon) -> None:
    done = running.ctl("scope", "--robot", "/nowhere/arm.urdf", "--no-browser")
    assert done.returncode != 0
    assert "--robot /nowhere/arm.urdf: no such file" in done.stderr


def test_meshes_need_the_token_and_a_known_name(arm: Daemon) -> None:
    with ScopeProcess(arm) as scope:
        assert scope.ask("/api/robot", token="")[0] == 403
        status, body = scope.ask("/api/robot/mesh?name=0")
        assert (status, body) == (400, b'{"refused": "no such mesh: load the robot again"}')
        status, _ = scope.ask("/api/robot")
        assert status == 200
        status, mesh = scope.ask("/api/robot/mesh?name=0")
        assert status == 200
        assert len(mesh) > 1000
