"""Divides lists into pages that fit into a message of any client.

A page token has the index of the page's first entry, and a digest of all names of the list.  So
rtcfd keeps nothing for its callers, and notices if a list has changed between two pages.
"""

import re
import zlib
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

from rtcf.v1 import errors_pb2

from rtcfd.common.errors import FailedPrecondition, InvalidArgument

LARGEST = 2 * 1024 * 1024  # bytes of one page; other gRPC clients accept 4 MiB
_TOKEN = re.compile(r"(\d{1,9})-([0-9a-f]{8})")

Entry = TypeVar("Entry")


class Request(Protocol):
    """The common fields of requests for lists."""

    page_size: int
    page_token: str


def page(
    entries: Sequence[Entry], request: Request, name: Callable[[Entry], str], size: int = 0
) -> tuple[list[Entry], str]:
    """Return the entries of the requested page, and the token of the next page (empty = none).

    `size` is the size in bytes of an entry that is not a message.
    """
    digest = f"{zlib.crc32(chr(0).join(map(name, entries)).encode()):08x}"
    begin = _begin(request.page_token, digest, len(entries))
    most = request.page_size or len(entries)
    end, room = begin, LARGEST
    while end < len(entries) and end - begin < most:
        room -= size if size else _size(entries[end])
        if room < 0 and end > begin:
            break
        end += 1
    return list(entries[begin:end]), f"{end}-{digest}" if end < len(entries) else ""


def _begin(token: str, digest: str, entries: int) -> int:
    if not token:
        return 0
    found = _TOKEN.fullmatch(token)
    if not found or (found[2] == digest and not 0 < int(found[1]) < entries):
        raise InvalidArgument(
            f'page token "{token[:40]}" does not belong to this list: use next_page_token of the '
            "previous page",
            errors_pb2.REASON_PAGE_TOKEN_INVALID,
            field="page_token",
        )
    if found[2] != digest:
        raise FailedPrecondition(
            "the list has changed since its first page: request the first page again",
            errors_pb2.REASON_LIST_CHANGED,
        )
    return int(found[1])


def _size(entry: Any) -> int:
    # 8: the tag and the length of the field.
    return 8 + (len(entry.encode()) if isinstance(entry, str) else int(entry.ByteSize()))
