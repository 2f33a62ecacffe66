"""Conventions of the protocol rtcf.v1."""

import keyword
import re
import subprocess
from collections.abc import Iterator

import pytest
from google.protobuf.descriptor import Descriptor, EnumDescriptor, FieldDescriptor, FileDescriptor
from pages import TREE
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2, runner_pb2

FILES: list[FileDescriptor] = [
    each.DESCRIPTOR for each in (control_pb2, errors_pb2, graph_pb2, runner_pb2)
]
SERVICE = control_pb2.DESCRIPTOR.services_by_name["Control"]
NUMBERS = (
    FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT, FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64, FieldDescriptor.CPPTYPE_UINT32, FieldDescriptor.CPPTYPE_UINT64,
)  # fmt: skip
# Words of time, frequency and size, which need units.
DIMENSIONS = re.compile(
    r"(^|_)(time|timeout|interval|age|period|duration|frequency|spin|heap|stack)($|_)"
)
UNITS = ("_ns", "_us", "_ms", "_s", "_hz", "_kb")
# Responses of calls that report only completion.
STREAMED = {"Add", "Set", "Remove", "Restart", "Start", "Stop", "Step", "Load", "Unload", "Replace",
            "Restore", "Apply", "Release", "Undo", "Reload", "Replay", "Hold", "Lease",
            "Read", "Watch", "Write"}  # fmt: skip


def messages() -> Iterator[Descriptor]:
    def below(message: Descriptor) -> Iterator[Descriptor]:
        yield message
        for nested in message.nested_types:
            yield from below(nested)

    for file in FILES:
        for message in file.message_types_by_name.values():
            yield from below(message)


def enums() -> Iterator[EnumDescriptor]:
    for file in FILES:
        yield from file.enum_types_by_name.values()
    for message in messages():
        yield from message.enum_types


@pytest.mark.parametrize("message", messages(), ids=lambda message: str(message.full_name))
def test_fields_are_numbered_densely_and_in_order(message: Descriptor) -> None:
    assert [each.number for each in message.fields] == list(range(1, len(message.fields) + 1))


@pytest.mark.parametrize("enum", enums(), ids=lambda enum: str(enum.full_name))
def test_values_of_an_enum_are_dense_and_begin_with_unspecified(enum: EnumDescriptor) -> None:
    assert sorted(each.number for each in enum.values) == list(range(len(enum.values)))
    assert enum.values_by_number[0].name.endswith("_UNSPECIFIED")


@pytest.mark.parametrize("message", messages(), ids=lambda message: str(message.full_name))
def test_no_field_is_a_word_of_python(message: Descriptor) -> None:
    assert [each.name for each in message.fields if keyword.iskeyword(each.name)] == []


@pytest.mark.parametrize("message", messages(), ids=lambda message: str(message.full_name))
def test_a_number_with_a_unit_names_it(message: Descriptor) -> None:
    for field in message.fields:
        if field.cpp_type in NUMBERS and DIMENSIONS.search(field.name):
            assert field.name.endswith(UNITS), field.full_name


@pytest.mark.parametrize("method", SERVICE.methods, ids=lambda method: str(method.name))
def test_each_call_has_its_own_messages(method: object) -> None:
    name: str = method.name  # type: ignore[attr-defined]
    asked: str = method.input_type.name  # type: ignore[attr-defined]
    answered: str = method.output_type.name  # type: ignore[attr-defined]
    assert asked == f"{name}Request"
    assert answered.endswith("Response")  # a resource is a field of it, never the response itself


def test_changes_and_lasting_calls_are_streams() -> None:
    text = (TREE / "proto/rtcf/v1/control.proto").read_text(encoding="utf-8")
    for name, streamed in re.findall(r"rpc (\w+)\([^)]*\) returns \((stream )?", text):
        verb = re.match(r"[A-Z][a-z]+", name)
        assert verb is not None
        assert bool(streamed) == (verb[0] in STREAMED or name == "ResetState"), name


@pytest.mark.parametrize("method", SERVICE.methods, ids=lambda method: str(method.name))
def test_lists_come_in_pages(method: object) -> None:
    name: str = method.name  # type: ignore[attr-defined]
    if name.startswith("List") or name == "GetOrder":
        fields = {each.name for each in method.input_type.fields}  # type: ignore[attr-defined]
        assert {"page_size", "page_token"} <= fields
        answer = {each.name for each in method.output_type.fields}  # type: ignore[attr-defined]
        assert "next_page_token" in answer


def test_the_docs_match_the_comments() -> None:
    done = subprocess.run(
        [TREE / "tools" / "api-docs", "--check"], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
