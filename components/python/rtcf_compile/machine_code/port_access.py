"""The access of hooks to ports of numbers and arrays, as LLVM assembly (typed pointers, see
backend.py). It copies the values of inputs to the record before a hook runs, and those of outputs
to their slots after it. The runtime handles ports of messages and queues: see python_component.cpp.

The offsets in ports and slots are those of port.hpp and slot.hpp; value_ports.hpp asserts them.
"""

from collections.abc import Iterator, Sequence

from rtcf.component.declaration import Description, Input, Member, Output, own_field

STAMP = 0  # byte offset in a slot
SOURCE, SEEN = 0, 8  # byte offsets in an input
RAW, NOW = 0, 8  # byte offsets in an output
READ_MORE = "rtcf_python_read_more"
_UNROLLED = 64  # elements copied without a loop


def _transpose(size: int) -> str:
    """Return a function that transposes a matrix of elements of `size` bytes."""
    kind = f"i{8 * size}"
    return f"""
define internal void @rtcf_transpose_{size}(i8* %to, i8* %from, i64 %rows, i64 %columns) {{
  %target = bitcast i8* %to to {kind}*
  %source = bitcast i8* %from to {kind}*
  br label %row
row:
  %i = phi i64 [ 0, %0 ], [ %next_row, %row_done ]
  br label %element
element:
  %j = phi i64 [ 0, %row ], [ %next, %element ]
  %column = mul i64 %j, %rows
  %there = add i64 %column, %i
  %read = getelementptr {kind}, {kind}* %source, i64 %there
  %value = load {kind}, {kind}* %read
  %begin = mul i64 %i, %columns
  %here = add i64 %begin, %j
  %written = getelementptr {kind}, {kind}* %target, i64 %here
  store {kind} %value, {kind}* %written
  %next = add i64 %j, 1
  %more = icmp ult i64 %next, %columns
  br i1 %more, label %element, label %row_done
row_done:
  %next_row = add i64 %i, 1
  %more_rows = icmp ult i64 %next_row, %rows
  br i1 %more_rows, label %row, label %done
done:
  ret void
}}
"""


DECLARATIONS = f"""
declare void @{READ_MORE}(i8*, i8*, i8*)
declare i8* @memcpy(i8*, i8*, i64)
{_transpose(4)}{_transpose(8)}"""


def slot_value(member: Member) -> int:
    """Return the offset of a port's value in its slot, bytes.

    Eigen aligns a matrix whose size is a multiple of 16 bytes to them.
    """
    kind = member.type
    return 16 if kind.is_float and kind.count * kind.scalar.itemsize % 16 == 0 else 8


def inputs(description: Description) -> list[Member]:
    """Return the inputs in the order of a hook's ports; the outputs follow."""
    return [each for each in description.of(Input) if each.message is None]


def outputs(description: Description) -> list[Member]:
    """Return the outputs in the order of a hook's ports."""
    return [each for each in description.of(Output) if each.message is None]


class PortAccess:
    """The assembly around a hook, which uses `%record` (i8*) and `%ports` (i8**)."""

    def __init__(self, description: Description, used: set[str]) -> None:
        fields = description.record.fields
        assert fields is not None
        self._places = {name: int(field[1]) for name, field in fields.items()}
        self._used = used
        self.raised = self._places[own_field("raised")]  # the numbers in the text of an exception
        self._inputs, self._outputs = inputs(description), outputs(description)

    def read(self) -> str:
        """Return the instructions before the hook, which read inputs."""
        return "\n".join(
            line for i, each in enumerate(self._inputs) for line in self._read(each, f"i{i}", i)
        )

    def write(self) -> str:
        """Return the instructions after the hook, which copy the outputs that it has written."""
        first = len(self._inputs)
        return "\n".join(
            line
            for i, each in enumerate(self._outputs)
            for line in self._write(each, f"o{i}", first + i)
        )

    def _read(self, member: Member, name: str, index: int) -> Iterator[str]:
        yield from _port(name, index)
        yield from _loaded(f"{name}.source", f"{name}.port", SOURCE, "i8*")
        yield from _loaded(f"{name}.stamp", f"{name}.source", STAMP, "i64")
        yield from _loaded(f"{name}.seen", f"{name}.port", SEEN, "i64")
        yield f"  %{name}.fresh = icmp ne i64 %{name}.stamp, %{name}.seen"
        yield f"  %{name}.valid = icmp ne i64 %{name}.stamp, 0"
        yield f"  store i64 %{name}.stamp, i64* %{name}.seen.place"
        for field, found in (("new", "fresh"), ("valid", "valid")):
            if f"{member.name}__{field}" in self._used:
                place = self._places[f"{member.name}__{field}"]
                yield f"  %{name}.{found}.byte = zext i1 %{name}.{found} to i8"
                yield from _place(f"{name}.{found}.place", "record", place, "i8")
                yield f"  store i8 %{name}.{found}.byte, i8* %{name}.{found}.place"
        yield from _place(f"{name}.from", f"{name}.source", slot_value(member), "i8")
        yield from _place(f"{name}.to", "record", self._places[member.name], "i8")
        yield from _copy(member, name, to_port=False)
        more = [f"{member.name}__{each}" for each in ("age", "connected")]
        if not set(more) & self._used:
            return
        places = []
        for field in more:
            if field in self._used:
                yield from _place(f"{name}.{field}", "record", self._places[field], "i8")
            places.append(f"i8* %{name}.{field}" if field in self._used else "i8* null")
        yield f"  call void @{READ_MORE}(i8* %{name}.port, {', '.join(places)})"

    def _write(self, member: Member, name: str, index: int) -> Iterator[str]:
        yield from _loaded(
            f"{name}.written", "record", self._places[f"{member.name}__written"], "i8"
        )
        yield f"  %{name}.is_written = icmp ne i8 %{name}.written, 0"
        yield f"  br i1 %{name}.is_written, label %{name}.write, label %{name}.done"
        yield f"{name}.write:"
        yield from _port(name, index)
        yield from _loaded(f"{name}.raw", f"{name}.port", RAW, "i8*")
        yield from _place(f"{name}.from", "record", self._places[member.name], "i8")
        yield from _place(f"{name}.to", f"{name}.raw", slot_value(member), "i8")
        yield from _copy(member, name, to_port=True)
        yield from _loaded(f"{name}.now.place", f"{name}.port", NOW, "i64*")
        yield f"  %{name}.now = load atomic i64, i64* %{name}.now.place monotonic, align 8"
        yield from _place(f"{name}.stamp.place", f"{name}.raw", STAMP, "i64")
        yield f"  store i64 %{name}.now, i64* %{name}.stamp.place"
        yield f"  store i8 0, i8* %{name}.written.place"
        yield f"  br label %{name}.done"
        yield f"{name}.done:"


def _port(name: str, index: int) -> Iterator[str]:
    yield f"  %{name}.port.place = getelementptr i8*, i8** %ports, i64 {index}"
    yield f"  %{name}.port = load i8*, i8** %{name}.port.place"


def _place(name: str, base: str, offset: int, kind: str) -> Iterator[str]:
    """Yield the instructions for an address at an offset, bytes."""
    if kind == "i8":
        yield f"  %{name} = getelementptr i8, i8* %{base}, i64 {offset}"
        return
    yield f"  %{name}.byte = getelementptr i8, i8* %{base}, i64 {offset}"
    yield f"  %{name} = bitcast i8* %{name}.byte to {kind}*"


def _loaded(name: str, base: str, offset: int, kind: str) -> Iterator[str]:
    """Yield the instructions that load a value at an offset, and its address as `name.place`."""
    yield from _place(f"{name}.place", base, offset, kind)
    yield f"  %{name} = load {kind}, {kind}* %{name}.place"


def _copy(member: Member, name: str, to_port: bool) -> Iterator[str]:
    """Yield the instructions that copy a value.

    Ports store matrices of floats in column-major order; records store arrays in row-major order.
    """
    kind = member.type
    size = kind.scalar.itemsize
    scalar = {4: "float", 8: "double"}[size] if kind.is_float else f"i{8 * size}"
    rows, columns = kind.shape if len(kind.shape) == 2 else (1, kind.count)
    if not kind.is_float or 1 in (rows, columns):
        if kind.count <= _UNROLLED:
            yield from _copy_elements(name, range(kind.count), size, scalar)
            return
        places = f"i8* %{name}.to, i8* %{name}.from"
        yield f"  %{name}.copied = call i8* @memcpy({places}, i64 {kind.count * size})"
        return
    # A row in one order is a column in the other.
    along, across = (columns, rows) if to_port else (rows, columns)
    if kind.count > _UNROLLED:
        yield (
            f"  call void @rtcf_transpose_{size}"
            f"(i8* %{name}.to, i8* %{name}.from, i64 {along}, i64 {across})"
        )
        return
    sources = [j * along + i for i in range(along) for j in range(across)]
    yield from _copy_elements(name, sources, size, scalar)


def _copy_elements(name: str, sources: Sequence[int], size: int, kind: str) -> Iterator[str]:
    """Yield instructions that load all elements by index, then store them in order.

    LLVM vectorises this sequence.
    """
    for target, source in enumerate(sources):
        own = f"{name}.{target}"
        yield from _place(f"{own}.from", f"{name}.from", size * source, kind)
        yield f"  %{own} = load {kind}, {kind}* %{own}.from"
    for target in range(len(sources)):
        own = f"{name}.{target}"
        yield from _place(f"{own}.to", f"{name}.to", size * target, kind)
        yield f"  store {kind} %{own}, {kind}* %{own}.to"


def entry(
    symbol: str,
    inner: str,
    taken: tuple[str, str],
    access: PortAccess,
    has_ports: bool,
    writes_always: bool = False,
) -> str:
    """Return the C entry function of a hook, which returns null or the exception.

    In tables.hpp it is a HookFunction, or a PortHookFunction with ports. `taken`: the parameter
    types of the record and of the exception in the inner function. `writes_always`: write outputs
    after an exception too.
    """
    record, exception = taken
    read = access.read() if has_ports else ""
    write = access.write() if has_ports else ""
    # No other pointer refers to the record while a hook runs: it is noalias.
    ports = ", i8** %ports" if has_ports else ""
    return f"""
declare i32 @{inner}(i8**, {exception}, {record})

define i8* @{symbol}(i8* noalias %record{ports}) {{
  call void @rtcf_begin_hook()
  %result = alloca i8*
  %raised = alloca i8*
  store i8* null, i8** %result
  store i8* null, i8** %raised
{read}
  %self = bitcast i8* %record to {record}
  %place = bitcast i8** %raised to {exception}
  %status = call i32 @{inner}(i8** %result, {exception} %place, {record} %self)
  call void @rtcf_end_hook()
{write if writes_always else ""}
  %fine = icmp eq i32 %status, 0
  %none = icmp eq i32 %status, -2
  %good = or i1 %fine, %none
  br i1 %good, label %ended, label %fault
ended:
{"" if writes_always else write}
  ret i8* null
fault:
  %values = load [2 x i64], [2 x i64]* @rtcf_raised_values
  %there = getelementptr i8, i8* %record, i64 {access.raised}
  %head = bitcast i8* %there to [2 x i64]*
  store [2 x i64] %values, [2 x i64]* %head, align 8
  %exception = load i8*, i8** %raised
  ret i8* %exception
}}
"""
