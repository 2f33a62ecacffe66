"""A parser of RealtimeSanitizer's reports: the function called and its stack."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import zip_longest

_BEGIN = re.compile(r"^==\d+==ERROR: RealtimeSanitizer: (\S+)")
_CALLED = re.compile(r"(?:unsafe function|blocking function) `(.*)` in real-time context")
_FRAME = re.compile(r"^\s+#(\d+) 0x[0-9a-f]+ (?:in (.*)|\((.*)\))$")
_PLACE = re.compile(r"^(.*?) (/[^:]*|[^:\s]+\.\w+):(\d+)(?::\d+)?(?: \(discriminator \d+\))?$")
_FILE_ONLY = re.compile(r"^(.*?) (?:/\S+\.\w+|\?\?:[?0])$")
_MODULE = re.compile(r"^(.*?) \((\S+)\)(?: \(BuildId: .*\))?$")
_BUILD_ID = re.compile(r" \(BuildId: [0-9a-f]*\)$")

# Functions of the executor, and those of them that call the hooks of components.
_EXECUTOR = "rtcf::executor::"
_CALLERS = re.compile(r"\brtcf::executor::(Loop|Instance)::")
# Sources that do not belong to the component's author.
_LIBRARIES = ("/usr/include/", "/usr/lib/")


@dataclass(frozen=True)
class Frame:
    """One frame of a stack; `file` and `line` are empty without debug information."""

    function: str
    file: str = ""
    line: int = 0

    @property
    def of_library(self) -> bool:
        """Whether the function belongs to the compiler's or another library."""
        return self.file.startswith(_LIBRARIES)


@dataclass
class Violation:
    """One report of the sanitizer."""

    kind: str  # e.g. "unsafe-library-call"
    called: str = ""  # e.g. "malloc"
    frames: list[Frame] = field(default_factory=list)  # innermost first

    @property
    def component_frames(self) -> list[Frame]:
        """The frames from the function called up to the component's hook, innermost first."""
        own = list(self.frames[1 : self._caller])  # the first is the sanitizer's own
        return own if any(_EXECUTOR not in frame.function for frame in own) else []

    @property
    def short_frames(self) -> list[Frame]:
        """`component_frames` without the internals of libraries: only their entry functions."""
        frames = self.component_frames
        return [
            frame
            for frame, below in zip_longest(frames, frames[1:])
            if not (below and frame.of_library and below.of_library)
        ]

    @property
    def of_executor(self) -> bool:
        """Whether no code of a component was running."""
        return not self.component_frames and self._caller != 1

    @property
    def _caller(self) -> int:
        """The index of the executor's frame that called the hook."""
        for pattern in (_CALLERS, re.compile(re.escape(_EXECUTOR))):
            for index, frame in enumerate(self.frames):
                if pattern.search(frame.function):
                    return index
        return len(self.frames)


def violations(lines: Iterable[str]) -> Iterator[Violation]:
    """Yield the reports in the lines of a sanitizer's output."""
    current: Violation | None = None
    for line in lines:
        if begin := _BEGIN.match(line):
            if current is not None:
                yield current
            current = Violation(begin[1])
        elif current is None:
            continue
        elif called := _CALLED.search(line):
            current.called = called[1]
        elif frame := _FRAME.match(line):
            current.frames.append(_frame(frame[2] or "", frame[3] or ""))
        elif line.startswith("SUMMARY: "):
            yield current
            current = None
    if current is not None:
        yield current


def _frame(text: str, module: str) -> Frame:
    text = _BUILD_ID.sub("", text)
    if not text:
        return Frame(f"({module})")
    if place := _PLACE.match(text):
        return Frame(place[1], place[2], int(place[3]))
    if known := _FILE_ONLY.match(text):
        return Frame(known[1])
    if inside := _MODULE.match(text):
        return Frame(inside[1] or f"({inside[2]})")
    return Frame(text)
