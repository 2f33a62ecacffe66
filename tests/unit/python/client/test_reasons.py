"""Errors for programs: one list of reasons, each of them used, each with an exception, readable
as google.rpc.Status."""

import re
from typing import Any
from urllib.parse import quote

import grpc
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from pages import TREE
from rtcf import errors, failures
from rtcf.reasons import BY_REASON
from rtcf.v1 import errors_pb2
from rtcfd.common import errors as daemon_errors
from rtcfd.common import status_codes
from rtcfd.common.errors import RequestError

REASONS = [each.name for each in errors_pb2.Reason.DESCRIPTOR.values if each.number]
ON_STANDARD_ERROR = {"REASON_DAEMON_FAILED"}


class _Failed(grpc.RpcError):  # type: ignore[misc]
    """gRPC's exception in a client."""

    def __init__(self, error: RequestError) -> None:
        self._error = error

    def code(self) -> grpc.StatusCode:
        return status_codes.status_code(self._error)

    def details(self) -> str:
        return status_codes.bounded(self._error)

    def trailing_metadata(self) -> list[tuple[str, bytes]]:
        return [(status_codes.DETAILS_KEY, status_codes.details(self._error))]


def test_each_reason_has_an_exception_documented_as_in_the_protocol() -> None:
    text = (TREE / "proto/rtcf/v1/errors.proto").read_text(encoding="utf-8")
    said = dict(re.findall(r"^  (REASON_\w+) = \d+; *// (.*)$", text, re.M))
    assert set(said) == set(REASONS)
    assert set(BY_REASON) == {n.removeprefix("REASON_") for n in set(REASONS) - ON_STANDARD_ERROR}
    for reason, kind in BY_REASON.items():
        assert kind.__name__ == "".join(map(str.capitalize, reason.split("_"))) + "Error"
        document = " ".join((kind.__doc__ or "").split())
        assert document.lower() == said[f"REASON_{reason}"].lower() + "."


def test_reason_numbers_are_dense() -> None:
    assert sorted(errors_pb2.Reason.values()) == list(range(len(REASONS) + 1))


def test_a_client_gets_the_exception_of_the_reason_with_its_subject() -> None:
    error = daemon_errors.NotFound(
        "no runner", errors_pb2.REASON_RUNNER_NOT_FOUND, runner="arm", suggestion="arms", field=""
    )
    found = failures.from_grpc(_Failed(error), "/nowhere")
    assert type(found) is BY_REASON["RUNNER_NOT_FOUND"]
    assert isinstance(found, errors.RefusedError)
    assert (str(found), found.code, found.reason) == ("no runner", "NOT_FOUND", "RUNNER_NOT_FOUND")
    assert found.about == {"runner": "arm", "suggestion": "arms"}


def test_an_unknown_reason_of_a_newer_rtcfd_is_still_an_error() -> None:
    found = failures.refused("because", "ABORTED", "MOON_IS_FULL")
    assert type(found) is errors.RefusedError
    assert found.reason == "MOON_IS_FULL"


@pytest.mark.parametrize("garbage", [b"\xff\xff", b"\x1a\x04\x12\x02ab", b"\x1a"])
def test_damaged_details_keep_the_message(garbage: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    failed = _Failed(daemon_errors.NotFound("no such thing", errors_pb2.REASON_PORT_NOT_FOUND))
    monkeypatch.setattr(failed, "trailing_metadata", lambda: [(status_codes.DETAILS_KEY, garbage)])
    found = failures.from_grpc(failed, "/nowhere")
    assert isinstance(found, errors.RefusedError)
    assert (str(found), found.reason) == ("no such thing", "")


@seed(7)
@settings(max_examples=200)
@given(
    st.text(max_size=20_000),
    st.dictionaries(
        st.sampled_from(["runner", "component", "port", "user", "field", "holder"]),
        st.text(max_size=5000),
    ),
)
def test_an_error_fits_into_any_clients_metadata(text: str, about: dict[str, str]) -> None:
    error = daemon_errors.NotFound(text, errors_pb2.REASON_PORT_NOT_FOUND, **about)
    line = quote(status_codes.bounded(error))
    details = status_codes.details(error)
    assert len(line) + (len(details) + 2) // 3 * 4 < 8 * 1024 - 512  # for other headers
    status = errors_pb2.ErrorStatus.FromString(details)
    assert quote(status.message) == line


def _googles_messages() -> Any:
    """Return google.rpc's Status and ErrorInfo, as in a process with googleapis."""
    file = descriptor_pb2.FileDescriptorProto(name="google/rpc/test.proto", package="google.rpc")
    file.syntax = "proto3"
    file.dependency.append("google/protobuf/any.proto")
    kind = descriptor_pb2.FieldDescriptorProto
    status = file.message_type.add(name="Status")
    one, many = kind.LABEL_OPTIONAL, kind.LABEL_REPEATED
    status.field.add(name="code", number=1, type=kind.TYPE_INT32, label=one)
    status.field.add(name="message", number=2, type=kind.TYPE_STRING, label=one)
    status.field.add(
        name="details", number=3, type=kind.TYPE_MESSAGE, label=many,
        type_name=".google.protobuf.Any",
    )  # fmt: skip
    info = file.message_type.add(name="ErrorInfo")
    info.field.add(name="reason", number=1, type=kind.TYPE_STRING, label=one)
    info.field.add(name="domain", number=2, type=kind.TYPE_STRING, label=one)
    info.field.add(
        name="metadata", number=3, type=kind.TYPE_MESSAGE, label=many,
        type_name=".google.rpc.ErrorInfo.MetadataEntry",
    )  # fmt: skip
    entry = info.nested_type.add(name="MetadataEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=kind.TYPE_STRING, label=one)
    entry.field.add(name="value", number=2, type=kind.TYPE_STRING, label=one)
    # The pool of all modules: two definitions of the same name would fail here.
    pool = descriptor_pool.Default()
    pool.Add(file)
    make = message_factory.MessageFactory(pool).GetPrototype
    return (
        make(pool.FindMessageTypeByName("google.rpc.Status")),
        make(pool.FindMessageTypeByName("google.rpc.ErrorInfo")),
    )


def test_googleapis_can_read_the_details_in_the_same_process() -> None:
    error = daemon_errors.AlreadyExists(
        "there already", errors_pb2.REASON_COMPONENT_EXISTS, runner="arm", component="/pid"
    )
    status_type, info_type = _googles_messages()
    status = status_type.FromString(status_codes.details(error))
    assert (status.code, status.message) == (6, "there already")
    (detail,) = status.details
    info = info_type()
    assert detail.Unpack(info)  # this checks the type's full name
    assert (info.reason, info.domain) == ("COMPONENT_EXISTS", "rtcf")
    assert dict(info.metadata) == {"runner": "arm", "component": "/pid"}
