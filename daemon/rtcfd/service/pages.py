"""Lists in pages: entries that fit into a message of any client, and where the next ones begin.

A page's token has the place where it begins and a digest of the names of the whole list, so
that nothing is kept for callers, and a list that has changed meanwhile is not taken for whole.
"""

import re
import zlib
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

from rtcf.v1 import errors_pb2

from rtcfd.common.refusals import FailedPrecondition, InvalidArgument

LARGEST = 2 * 1024 * 1024  # bytes of one page; clients that are not ours take 4 MiB
_TOKEN = re.compile(r"(\d{1,9})-([0-9a-f]{8})")

Entry = TypeVar("Entry")


class Request(Protocol):
    """What the requests for lists have in common."""

    page_size: int
    page_token: str


def page(
    entries: Sequence[Entry], request: Request, name: Callable[[Entry], str], size: int = 0
) -> tuple[list[Entry], str]:
    """Return the entries that a request is for, and the next page's token, empty if there is none.

    `size`: bytes of an entry that is no message.
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
            f'page token "{token[:40]}" is none of this list: take next_page_token of the page '
            "before",
            errors_pb2.REASON_PAGE_TOKEN_INVALID,
            field="page_token",
        )
    if found[2] != digest:
        raise FailedPrecondition(
            "the list has changed since its first page: ask for that again",
            errors_pb2.REASON_LIST_CHANGED,
        )
    return int(found[1])


def _size(entry: Any) -> int:
    # A tag and a length besides.
    return 8 + (len(entry.encode()) if isinstance(entry, str) else int(entry.ByteSize()))
