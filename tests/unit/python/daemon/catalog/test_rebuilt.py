"""A library that changes on disk: reported in every view, and loaded on request."""

import asyncio
import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import rtcf
from daemon_process import DEADLINE_S, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2
from rtcfd.operations import loaded_code
from rtcfd_in_process import Rtcfd, spec


def rebuild(library: Path) -> None:
    """Replace the file with another one of the same content, as a package manager does."""
    new = library.with_suffix(".new")
    new.write_text(library.read_text())
    os.replace(new, library)


def test_a_changed_library_is_reported_and_loaded_by_replace(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    library = daemon.package("late", types={"Late": "fine"})
    client.load(rtcf.component("late", "Late", name="a"))
    client.load(rtcf.component("demo", "Fine", name="b"))
    assert not client.get_status().runners[0].libraries_changed
    rebuild(library)
    assert list(client.get_status().runners[0].libraries_changed) == [str(library)]
    assert f"{library} has changed since its components were loaded" in daemon.ctl("status").stdout
    assert [each.library_changed for each in client.list_components()] == [True, False]
    assert "library changed" in daemon.ctl("list").stdout
    assert "`rtcfctl replace /a --rebuilt` loads it" in daemon.ctl("info", "a").stdout
    done = daemon.ctl("replace", "a", "--rebuilt")
    assert done.stdout == "replaced a by /a\n", done.stderr
    assert not client.get_status().runners[0].libraries_changed
    assert not client.get_component("a").library_changed


def test_replace_needs_a_type_or_a_rebuilt_library(daemon: DaemonUnderTest) -> None:
    for words in (["a"], ["a", "demo"], ["a", "demo", "Fine", "--rebuilt"]):
        done = daemon.ctl("replace", *words)
        assert done.returncode == 2, words
        assert "specify PKG COMPONENT or --rebuilt" in done.stderr


def test_apply_reports_that_old_code_keeps_running(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    library = daemon.package("late", types={"Late": "fine"})
    graph = tmp_path / "graph.yaml"
    graph.write_text("components:\n  - {package: late, type: Late}\n")
    assert daemon.ctl("apply", str(graph)).stderr == ""
    rebuild(library)
    said = daemon.ctl("apply", str(graph)).stderr
    assert said.startswith("rtcfctl: note: the library of /Late has changed since it was loaded")
    assert said.endswith("--rebuilt loads the new one\n")


def test_a_library_changed_during_a_restart_of_rtcfd_is_reported(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon.start_service()
    library = daemon.package("late", types={"Late": "fine"})
    with daemon.client() as client:
        client.load(rtcf.component("late", "Late"))
    daemon.end(signal.SIGUSR1)
    rebuild(library)
    daemon.start_service()
    with daemon.client() as client:
        wait_for(lambda: client.get_status().runners[0].libraries_changed, "the change")


def test_a_hanging_folder_does_not_delay_saving_a_stop(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = threading.Event()

    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        await daemon.call("Load", control_pb2.LoadRequest(component=spec("a")))
        await daemon.call("Start", control_pb2.StartRequest())
        monkeypatch.setattr(loaded_code, "_identity", lambda _: answers.wait())
        # More than the default threads of asyncio.
        looks = [
            asyncio.create_task(daemon.call("GetStatus", control_pb2.GetStatusRequest()))
            for _ in range(40)
        ]
        try:
            async with asyncio.timeout(DEADLINE_S):
                await daemon.call("Stop", control_pb2.StopRequest())
                saved = daemon.saved("rt_runner")
                assert saved is not None and saved["running"] is False
                await asyncio.gather(*looks)  # no data on the library
                await daemon.call("Load", control_pb2.LoadRequest(component=spec("b")))
        finally:
            answers.set()
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
