"""`rtcfctl graph`: a graph as text and as drawings by Graphviz."""

import json
import re
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import fig_1
import graphs
import pytest
import rtcf
from daemon_process import Daemon

_MANY = 200


@pytest.fixture
def loaded(daemon: Daemon, client: rtcf.Client) -> Iterator[Daemon]:
    """Yield a daemon with Fig. 1 of the paper."""
    fig_1.load(client)
    yield daemon


def test_the_text_lists_order_and_connections(loaded: Daemon) -> None:
    done = loaded.ctl("graph")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    heads = [line for line in lines if re.match(r"\d", line)]
    order = loaded.ctl("order").stdout.split()
    assert [head.split()[1] for head in heads] == order
    text = done.stdout
    assert "out1 → /F1.in1" in text
    assert "/H1.in2 (loop break)" in text
    told = json.loads(loaded.ctl("graph", "--output", "json").stdout)
    assert [each["full_name"] for each in told["components"]] == order


def test_drawings_show_every_component(loaded: Daemon, tmp_path: Path) -> None:
    drawing = tmp_path / "fig_1.svg"
    done = loaded.ctl("graph", "-o", str(drawing))
    assert (done.returncode, done.stdout) == (0, f"{drawing}: 5 components\n"), done.stderr
    titles = [each.text for each in ElementTree.parse(drawing).iter() if each.tag.endswith("title")]
    assert {"/H1", "/F1", "/R1", "/R2", "/R3"} <= set(titles)
    assert "/R3->/H1" in titles
    assert loaded.ctl("graph", "-o", str(tmp_path / "fig_1.png")).returncode == 0
    assert (tmp_path / "fig_1.png").read_bytes().startswith(b"\x89PNG")
    assert loaded.ctl("graph", "-o", str(tmp_path / "fig_1.dot")).returncode == 0
    assert "style=dashed" in (tmp_path / "fig_1.dot").read_text()


def test_drawings_show_topics_and_namespaces(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="w", ns="/arm/left"))
    file = daemon.folder / "x.dot"
    assert daemon.ctl("graph", "-o", str(file)).returncode == 0
    assert 'label="/arm/left"' in file.read_text()


def test_large_graphs_can_be_drawn(client: rtcf.Client, daemon: Daemon, tmp_path: Path) -> None:
    client.apply(
        [
            rtcf.component(
                "rtcf_examples", "Mimo", name=f"m{i}", ns=f"/arm{i // 40}",
                remaps=[f"out1:=/s{i}", f"in1:=/s{i - 1}"] if i % 8 else [f"out1:=/s{i}"],
            )
            for i in range(_MANY)
        ]
    )  # fmt: skip
    drawing = tmp_path / "many.svg"
    done = daemon.ctl("graph", "-o", str(drawing))
    assert done.returncode == 0, done.stderr
    titles = {each.text for each in ElementTree.parse(drawing).iter() if each.tag.endswith("title")}
    assert {f"/arm{i // 40}/m{i}" for i in range(_MANY)} <= titles


@pytest.mark.parametrize("name", list(graphs.GRAPHS))
def test_long_and_wide_graphs_fit_a_screen(
    client: rtcf.Client, daemon: Daemon, tmp_path: Path, name: str
) -> None:
    client.apply(graphs.GRAPHS[name])
    drawing = tmp_path / "large.svg"
    done = daemon.ctl("graph", "-o", str(drawing))
    assert done.returncode == 0, done.stderr
    root = ElementTree.parse(drawing).getroot()
    wide, high = (float(root.get(each, "").removesuffix("pt")) for each in ("width", "height"))
    assert 0.4 < wide / high < 4 and wide < 4000
    titles = [each.text for each in root.iter() if each.tag.endswith("title")]
    lines = graphs.LINES[name]
    assert {graphs.name(number) for number in range(_MANY)} <= set(titles)
    assert sorted(each for each in titles if each and "->" in each) == sorted(
        f"{graphs.name(a)}->{graphs.name(b)}" for a, b in lines
    )
    texts = [each.text for each in root.iter() if each.tag.endswith("text")]
    broken = sum(graphs.is_break(*each) for each in lines)
    assert texts.count("1/z") == broken
    dashed = [each for each in root.iter() if each.get("stroke-dasharray")]
    assert len([each for each in dashed if each.tag.endswith("path")]) == broken
    boxes = dict(boxes_in(root))
    assert len({(round(x), round(y)) for x, y in boxes.values()}) >= _MANY
    for a, b in boxes.values():
        assert -1 <= a <= wide and -high - 1 <= b <= 1
    # The .dot file has the same positions, for any program that draws it.
    source = tmp_path / "large.dot"
    assert daemon.ctl("graph", "-o", str(source)).returncode == 0
    again = subprocess.run(["dot", "-Tsvg", source], capture_output=True, check=True).stdout
    assert dict(boxes_in(ElementTree.fromstring(again))) == boxes


def boxes_in(root: ElementTree.Element) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the centre of each node of a drawing."""
    for group in root.iter():
        if group.get("class") == "node":
            title, text = (
                next(each for each in group.iter() if each.tag.endswith(tag))
                for tag in ("title", "text")
            )
            yield title.text or "", (float(text.get("x", "")), float(text.get("y", "")))


def test_a_short_chain_is_drawn_from_left_to_right(
    client: rtcf.Client, daemon: Daemon, tmp_path: Path
) -> None:
    client.apply(graphs.chain(8, closed=True))
    drawing = tmp_path / "short.svg"
    assert daemon.ctl("graph", "-o", str(drawing)).returncode == 0
    root = ElementTree.parse(drawing).getroot()
    boxes = dict(boxes_in(root))
    across = [boxes[graphs.name(number)][0] for number in range(8)]
    assert across == sorted(across)
    texts = [(each.text or "").strip() for each in root.iter() if each.tag.endswith("text")]
    assert sum(each.endswith("1/z") for each in texts) == 1


@pytest.mark.parametrize(
    ("file", "code", "said"),
    [
        ("x.gif", 2, "use one of .svg, .png, .dot"),
        ("no/x.dot", 1, "No such file or directory"),
    ],
)
def test_errors_are_one_line(
    daemon: Daemon, tmp_path: Path, file: str, code: int, said: str
) -> None:
    done = daemon.ctl("graph", "-o", str(tmp_path / file))
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]


def test_without_graphviz_the_package_is_named(loaded: Daemon, tmp_path: Path) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "python3").symlink_to("/usr/bin/python3")
    ctl = loaded.environment()["PATH"].split(":")[0] + "/rtcfctl"
    done = loaded.run("env", f"PATH={programs}", "/usr/bin/python3", ctl, "graph", "-o",
                      str(tmp_path / "x.svg"))  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == (
        "rtcfctl: Graphviz not found: sudo apt install graphviz, or write a .dot file\n"
    )
    assert not (tmp_path / "x.svg").exists()
