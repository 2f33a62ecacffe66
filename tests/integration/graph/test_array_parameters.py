"""An array parameter of a component in C++: a parameter for each element, on all ways in."""

from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from values import iteration, port_value

GRAPH = """\
components:
  - {package: rtcf_test, type: Polynomial, name: poly, parameters: {coefficients_1: 3.0}}
"""


@pytest.fixture
def poly(daemon: Daemon, client: rtcf.Client) -> str:
    loaded = daemon.ctl(
        *("load", "rtcf_test", "Polynomial", "--name", "poly"),
        *("--param", "coefficients_0:=2", "--param", "coefficients_2:=0.5"),
    )
    assert loaded.returncode == 0, loaded.stderr
    return "poly"


def test_an_element_is_set_at_the_load_and_while_the_loop_runs(
    daemon: Daemon, client: rtcf.Client, poly: str
) -> None:
    client.step(1)
    assert port_value(client, poly, "sum") == 2.5
    assert daemon.ctl("write", f"{poly}.x", "2.0").returncode == 0
    client.start()
    assert daemon.ctl("set", poly, "coefficients_1:=-1.0").returncode == 0
    wait_for(lambda: port_value(client, poly, "y") == 2.0 - 2.0 + 2.0, "the new coefficient")
    assert daemon.ctl("undo", poly).returncode == 0
    wait_for(lambda: port_value(client, poly, "y") == 2.0 + 2.0, "the old coefficient")
    shown = daemon.ctl("info", poly).stdout
    for line in ("coefficients_0", "coefficients_1", "coefficients_2"):
        assert line in shown
    assert "coefficients " not in shown


@pytest.mark.parametrize(
    ("batch", "words"),
    [
        (["coefficients_0:=5.0", "coefficients_2:=-1.0"], ["coefficients_2 = -1", "bends down"]),
        (["coefficients_0:=5.0", "coefficients_1:=101.0"], ["coefficients_1 = 101", "maximum 100"]),
        (["coefficients_0:=5.0", "coefficients_3:=1.0"], ["coefficients_3"]),
        (["coefficients:=5.0"], ["coefficients", "coefficients_0"]),
    ],
)
def test_a_batch_with_an_invalid_element_changes_nothing(
    daemon: Daemon, client: rtcf.Client, poly: str, batch: list[str], words: list[str]
) -> None:
    rejected = daemon.ctl("set", poly, *batch)
    assert rejected.returncode != 0
    for word in words:
        assert word in rejected.stderr
    client.step(1)
    assert port_value(client, poly, "sum") == 2.5


def test_elements_that_are_set_together_change_in_the_same_cycle(
    client: rtcf.Client, poly: str
) -> None:
    client.start()
    sums: set[float] = set()
    with client.watch_ports([f"/{poly}.sum"]) as stream:
        for change in range(20):
            # Their sum never changes.
            client.set_parameters(
                poly,
                [
                    rtcf.parse_parameter(f"coefficients_0:={2.0 + change}"),
                    rtcf.parse_parameter(f"coefficients_1:={-float(change)}"),
                ],
            )
        last = iteration(client)
        for batch in stream:
            sums.update(batch[f"/{poly}.sum"].tolist())
            if batch.cycles[-1] >= last:
                break
    assert sums == {2.5}


def test_a_replacement_keeps_the_elements(daemon: Daemon, client: rtcf.Client, poly: str) -> None:
    assert daemon.ctl("set", poly, "coefficients_1:=4.0").returncode == 0
    assert daemon.ctl("replace", poly, "rtcf_test", "Polynomial").returncode == 0
    client.step(1)
    assert port_value(client, poly, "sum") == 6.5


def test_a_graph_file_sets_elements(daemon: Daemon, client: rtcf.Client, tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    applied = daemon.ctl("apply", str(file))
    assert applied.returncode == 0, applied.stderr
    client.step(1)
    assert port_value(client, "poly", "sum") == 4.0
