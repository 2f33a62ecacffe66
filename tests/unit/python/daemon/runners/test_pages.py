"""Paged lists: complete, in order, of limited size, and never mixed from two lists."""

import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.v1 import control_pb2, graph_pb2
from rtcfd.common.errors import FailedPrecondition, InvalidArgument
from rtcfd.service import pages
from rtcfd.service.pages import page

Request = control_pb2.ListComponentsRequest


def whole(names: list[str], size: int) -> tuple[list[str], int]:
    """Return a list as a client gets it, and the number of its pages."""
    found: list[str] = []
    request = Request(page_size=size)
    for count in range(1, len(names) + 2):
        entries, request.page_token = page(names, request, str)
        found += entries
        assert entries or not names
        assert len(entries) <= (size or len(names))
        if not request.page_token:
            return found, count
    raise AssertionError("it has no end")


@seed(11)
@settings(max_examples=200)
@given(st.lists(st.text(max_size=30), max_size=60), st.integers(0, 70))
def test_pages_make_up_the_list(names: list[str], size: int) -> None:
    found, count = whole(names, size)
    assert found == names
    assert count == (max(-(-len(names) // size), 1) if size else 1)


def test_a_page_fits_any_clients_message_limit() -> None:
    entries = [graph_pb2.ComponentInfo(full_name=f"/{n}", doc="x" * 300_000) for n in range(20)]
    request = Request()
    found = 0
    while True:
        part, request.page_token = page(entries, request, lambda each: str(each.full_name))
        response = control_pb2.ListComponentsResponse(components=part)
        assert 0 < response.ByteSize() < pages.LARGEST + 100_000
        found += len(part)
        if not request.page_token:
            break
    assert found == 20


def test_an_entry_larger_than_a_page_is_a_separate_page() -> None:
    entries = ["a", "x" * (pages.LARGEST + 1), "b"]
    first, token = page(entries, Request(), str)
    second, token = page(entries, Request(page_token=token), str)
    third, token = page(entries, Request(page_token=token), str)
    assert (first, second, third, token) == (entries[:1], entries[1:2], entries[2:], "")


def test_a_list_that_changed_is_reported() -> None:
    _, token = page(["a", "b", "c"], Request(page_size=1), str)
    with pytest.raises(FailedPrecondition, match="has changed"):
        page(["a", "c"], Request(page_token=token), str)


@pytest.mark.parametrize("token", ["1", "-1-00000000", "x" * 500, "9999999999-00000000", "1-zz"])
def test_an_invalid_token_is_rejected(token: str) -> None:
    with pytest.raises(InvalidArgument, match="does not belong to this list"):
        page(["a", "b"], Request(page_token=token), str)


@pytest.mark.parametrize("begin", [0, 2, 3])
def test_a_token_out_of_range_is_rejected(begin: int) -> None:
    _, token = page(["a", "b"], Request(page_size=1), str)
    with pytest.raises(InvalidArgument, match="does not belong to this list"):
        page(["a", "b"], Request(page_token=f"{begin}-{token.partition('-')[2]}"), str)
