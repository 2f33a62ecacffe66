"""Moves temporary arrays of constant size to the stack, by editing LLVM assembly.

After all functions of a hook are inlined, most arrays have a constant size, and only loads and
stores use their address. Such blocks of the arena become local variables, which LLVM keeps in
registers if possible. A block stays in the arena if its address is passed on, if a pointer may
refer to it or to another block, or if it is large.

One variable replaces all arrays that one allocation in the code makes, for instance in a loop:
pointers derived only from that allocation refer to the array that it made last.
"""

import re
from collections import defaultdict

_LARGEST, _ALL = 2048, 16 * 1024  # bytes
_DATA = 24  # offset of the data pointer in a block
_NAME = r'%(?:"[^"]*"|[\w.$-]+)'
_NAMES = re.compile(_NAME)
_MADE = re.compile(
    rf"  ({_NAME}) = (?:tail )?call (?:noalias )?(?:nonnull )?(?:i8\*|ptr) "
    r"@NRT_MemInfo_alloc(?:_safe)?_aligned\(i64 (?:noundef )?(\d+), i32 (?:noundef )?\d+\)"
)
_COUNTED = re.compile(r"  (?:tail )?call void @NRT_(?:incref|decref)\(")
_MOVED = re.compile(r"  (?:tail )?call void @llvm\.mem(?:cpy|set|move)\.")
_RESULT = re.compile(rf"  ({_NAME}) = (\w+) (.*)")
_OFFSET = re.compile(
    rf"(?:inbounds |nuw |nusw )*(i8|i64|double), [^,]*? ({_NAME}), i64 (-?\d+)(?:,|$)"
)
_TYPE = re.compile(r"(?:\{[^}]*\}|[^,{])*")
_STORED = re.compile(rf"  store .* ({_NAME})(?:, align \d+)?(?:, ![^,]*)*$")
_BYTES = {"i8": 1, "i64": 8, "double": 8}


def promoted(assembly: str) -> str:
    """Return assembly with blocks replaced by local variables where possible."""
    lines = assembly.split("\n")
    begin = None
    for number, line in enumerate(lines):
        if line.startswith("define "):
            begin = number
        elif line == "}" and begin is not None:
            lines[begin : number + 1] = [
                "\n".join(_Function(lines[begin : number + 1]).promoted()),
                *[""] * (number - begin),
            ]
            begin = None
    return "\n".join(lines)


class _Function:
    """The lines of one function in assembly."""

    def __init__(self, lines: list[str]) -> None:
        self._lines = lines
        self._uses: dict[str, list[int]] = defaultdict(list)
        for number, line in enumerate(lines):
            if line.startswith("  "):
                for name in set(_NAMES.findall(line)):
                    self._uses[name].append(number)

    def promoted(self) -> list[str]:
        """Return the changed lines."""
        variables: list[str] = []
        left = _ALL
        # Reference counting gets null for a block that becomes a variable.
        for number, line in enumerate(self._lines):
            if _COUNTED.match(line):
                self._lines[number] = line.replace("nonnull ", "")
        for number, line in enumerate(self._lines):
            found = _MADE.match(line)
            if found is None:
                continue
            name, size = found[1], max(int(found[2]), 1)
            changed = self._changed(name, number) if size <= min(_LARGEST, left) else None
            if changed is None:
                continue
            left -= size
            variable = f"%rtcf.array.{len(variables)}"
            variables.append(f"  {variable} = alloca [{size} x i8], align 16")
            typed = "ptr" if " ptr " in line else f"[{size} x i8]*"
            self._lines[number] = f"  {name} = bitcast {typed} {variable} to {_pointer(typed)}"
            for place, text in changed.items():
                self._lines[place] = text
        # Insert after the head and the label of the first basic block.
        first = next(i for i, line in enumerate(self._lines[1:], 1) if line.startswith("  "))
        return [*self._lines[:first], *variables, *self._lines[first:]]

    def _changed(self, made: str, where: int) -> dict[int, str] | None:
        """Return the changed lines if a block becomes a variable; None if it cannot."""
        # Offsets into the block by name; None: somewhere in its data.
        offsets: dict[str, int | None] = {made: 0}
        changed: dict[int, str] = {}
        merged: list[int] = []
        waiting = [made]
        while waiting:
            name = waiting.pop()
            for number in self._uses[name]:
                line = self._lines[number]
                if number == where or line.startswith(f"  {name} = "):
                    continue
                result = _RESULT.match(line)
                offset = offsets[name]
                if result is None:
                    if _COUNTED.match(line) and offset == 0:
                        changed[number] = ""
                    elif _MOVED.match(line) and offset is None:
                        changed[number] = line.replace("  tail call", "  call", 1)
                    elif not self._is_target(line, name) or offset is not None:
                        return None
                    continue
                derived, instruction, rest = result[1], result[2], result[3]
                further: int | None
                if instruction in ("icmp", "ptrtoint"):
                    continue
                if instruction == "load" and offset is None:
                    continue
                if instruction == "load" and offset == _DATA:
                    kind = _TYPE.match(rest)[0]  # type: ignore[index]
                    pointer = "ptr" if kind == "ptr" else "i8*"
                    changed[number] = f"  {derived} = bitcast {pointer} {made} to {kind}"
                    further = None
                elif instruction == "bitcast":
                    further = offset
                elif instruction == "getelementptr":
                    further = _moved(rest, name, offset)
                    if further is None and offset is not None:
                        return None
                elif instruction in ("phi", "select") and offset is None:
                    merged.append(number)
                    further = None
                elif instruction == "phi" and offset == 0 and self._is_counted(derived):
                    changed[number] = re.sub(rf"\[ {re.escape(name)}, ", "[ null, ", line)
                    continue
                else:
                    return None
                if derived not in offsets:
                    offsets[derived] = further
                    waiting.append(derived)
        if not all(set(self._merged(number)) <= set(offsets) for number in merged):
            return None
        return changed

    def _is_counted(self, name: str) -> bool:
        """Tell whether a name is used only to count references to a block."""
        uses = [self._lines[number] for number in self._uses[name]]
        return all(_COUNTED.match(line) or line.startswith(f"  {name} = ") for line in uses if line)

    def _is_target(self, line: str, name: str) -> bool:
        stored = _STORED.match(line)
        return stored is not None and stored[1] == name and line.count(name) == 1

    def _merged(self, number: int) -> list[str]:
        """Return the alternatives of a phi or select; constants as text."""
        result = _RESULT.match(self._lines[number])
        assert result is not None
        if result[2] == "phi":
            pairs = re.findall(r"\[ (.*?), %[^\]]* \]", result[3])
            return [each for each in pairs if each != "undef"]
        return [part.split(" ")[-1] for part in _plain(result[3]).split(", ")[1:3]]


def _moved(rest: str, name: str, offset: int | None) -> int | None:
    """Return the offset into the block of an address computed from another one."""
    found = _OFFSET.match(rest)
    if offset is None or found is None or found[2] != name:
        return None
    return offset + _BYTES[found[1]] * int(found[3])


def _plain(text: str) -> str:
    """Return operands with pointers to complex numbers as pointers to their first part."""
    return text.replace("{ double, double }", "double")


def _pointer(typed: str) -> str:
    return "ptr" if typed == "ptr" else "i8*"
