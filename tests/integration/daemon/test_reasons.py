"""Errors of a real rtcfd for programs: reason, domain and subject."""

import subprocess
import sys

import grpc
import pytest
import rtcf
from daemon_process import Daemon
from fig_1 import mimo
from pages import TREE
from rtcf import reasons
from rtcf.v1 import control_pb2, control_pb2_grpc, errors_pb2


def test_an_error_has_a_reason_and_suggests_a_name(client: rtcf.Client) -> None:
    with pytest.raises(reasons.RunnerNotFoundError) as refused:
        client.start("rt_runer")
    assert refused.value.about == {"runner": "rt_runer", "suggestion": "rt_runner"}
    with pytest.raises(reasons.TypeNotFoundError) as unknown:
        client.load(rtcf.component("rtcf_examples", "Minmo"))
    assert unknown.value.about["type"] == "Minmo"
    assert unknown.value.about["suggestion"] == "Mimo"
    client.load(mimo("A", {}))
    with pytest.raises(reasons.ComponentExistsError) as taken:
        client.load(mimo("A", {}))
    assert taken.value.code == "ALREADY_EXISTS"
    with pytest.raises(reasons.ComponentNotFoundError) as missing:
        client.get_component("B")
    assert missing.value.about["component"] == "B"


def test_any_grpc_client_finds_google_rpc_error_info(daemon: Daemon) -> None:
    with grpc.insecure_channel(f"unix:{daemon.socket}") as channel:
        stub = control_pb2_grpc.ControlStub(channel)  # type: ignore[no-untyped-call]
        with pytest.raises(grpc.RpcError) as failed:
            list(stub.Unload(control_pb2.UnloadRequest()))
    metadata = dict(failed.value.trailing_metadata())
    status = errors_pb2.ErrorStatus.FromString(metadata["grpc-status-details-bin"])
    assert status.code == failed.value.code().value[0]
    assert status.message == failed.value.details()
    (detail,) = status.details
    assert detail.type_url == "type.googleapis.com/google.rpc.ErrorInfo"
    info = errors_pb2.ErrorInfo.FromString(detail.value)
    assert (info.reason, info.domain) == ("NAME_MISSING", "rtcf")
    assert info.metadata["field"] == "components"


def test_the_client_of_the_protocols_page_works(daemon: Daemon) -> None:
    page = (TREE / "docs" / "api.md").read_text(encoding="utf-8")
    code = page.partition("```python\n")[2].partition("```")[0]
    assert 20 < len(code.splitlines()) <= 36
    done = subprocess.run(
        [sys.executable, "-", str(daemon.socket)],
        input=code,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(TREE / "build" / "python")},
        check=False,
    )
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines.count("done: /H1") == 2
    assert lines[-1].startswith("COMPONENT_EXISTS {")
