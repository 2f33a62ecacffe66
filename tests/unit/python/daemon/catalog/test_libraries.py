"""Libraries that fail to load, and libraries of the same package in several folders."""

from pathlib import Path

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest


@pytest.fixture
def later(stopped_daemon: DaemonUnderTest) -> Path:
    """Return a second folder of the search path, with a library of the package demo."""
    folder = stopped_daemon.folder / "later"
    (folder / "demo").mkdir(parents=True)
    library = folder / "demo" / "main.so"
    library.write_text('{"types": {"Fine": "fine", "Other": "fine"}}')
    stopped_daemon.start("--path", str(folder))
    return library


def offered(client: rtcf.Client, name: str) -> str:
    """Return the library that provides a type."""
    (library,) = (each.library for each in client.list_types("demo").types if each.type == name)
    return str(library)


def test_a_broken_library_is_not_replaced_by_one_of_another_folder(
    stopped_daemon: DaemonUnderTest, later: Path
) -> None:
    first = stopped_daemon.packages / "demo" / "main.so"
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
        assert offered(client, "Fine") == str(first)
        stopped_daemon.package("demo", problem="undefined symbol: _ZN3FooE")
        with pytest.raises(rtcf.RefusedError) as refused:
            client.load(rtcf.component("demo", "Fine", name="b"))
        assert refused.value.code == "FAILED_PRECONDITION"
        assert str(refused.value) == (
            f"demo/Fine: {first} does not load, and {later} in a later folder does not replace "
            f"it: repair or remove {first}: {first}: undefined symbol: _ZN3FooE"
        )
        # Only loadable types are offered.
        listed = client.list_types("demo")
        assert [each.type for each in listed.types] == []
        assert listed.problems == [f"{first}: undefined symbol: _ZN3FooE"]
        # By a deliberate change: without the first library, the later one is used.
        first.unlink()
        client.load(rtcf.component("demo", "Fine", name="b"))
        assert offered(client, "Fine") == str(later)


def test_a_component_of_a_broken_library_is_left_out_at_the_next_start(
    stopped_daemon: DaemonUnderTest, later: Path
) -> None:
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
    stopped_daemon.end()
    stopped_daemon.package("demo", problem="undefined symbol: _ZN3FooE")
    stopped_daemon.start("--path", str(later.parents[1]))
    with stopped_daemon.client() as client:
        assert client.get_order() == []
    said = "/a is left out of the loop: demo/Fine: "
    wait_for(lambda: said in stopped_daemon.log(), "the component left out")


def test_a_broken_library_hides_nothing_of_its_own_folder(
    stopped_daemon: DaemonUnderTest, later: Path
) -> None:
    stopped_daemon.package("demo", "broken", problem="undefined symbol: _ZN3FooE")
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
        assert offered(client, "Fine") == str(stopped_daemon.packages / "demo" / "main.so")
        with pytest.raises(rtcf.RefusedError, match="does not replace it"):
            client.load(rtcf.component("demo", "Other", name="b"))
