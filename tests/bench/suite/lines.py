"""Number of distinct cache lines of a cycle: misses after its caches were swept."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from processes import Failed, output_of
from result import Budget, Result
from setting import Setting

_LINE = 64  # bytes
_RDTSC = bytes((0x0F, 0x31))
_REGISTERS = (
    "rip", "rsp", "rax", "rbx", "rcx", "rdx", "rsi", "rdi", "rbp", "r8", "r9", "r10", "r11", "r12",
    "r13", "r14", "r15", "fs",
)  # fmt: skip
_GRAPHS = {"fig1": "Fig. 1", "100": "chain of 100", "1000": "chain of 1000"}


@dataclass
class Lines:
    """Numbers of the lines that instructions touch."""

    data: set[int] = field(default_factory=set)
    code: set[int] = field(default_factory=set)


def _touch(lines: set[int], address: int, size: int) -> None:
    lines.update(range(address // _LINE, (address + max(size, 1) - 1) // _LINE + 1))


def _steps(trace: str) -> Iterator[tuple[bytes, dict[str, int]]]:
    """Yield the instructions of the cycle, from its first read of the counter on."""
    steps = []
    for line in trace.splitlines():
        code, *values = line.split()
        registers = {name: int(value, 16) for name, value in zip(_REGISTERS, values, strict=True)}
        steps.append((bytes.fromhex(code), registers))
    reads = [place for place, (code, _) in enumerate(steps) if code.startswith(_RDTSC)]
    if len(reads) < 4:  # two around the cycle, and two in it
        raise Failed("the trace contains no cycle")
    yield from steps[reads[1] : reads[-1]]


def lines_of(trace: str) -> Lines:
    """Return the lines of the traced cycle.  Raises Failed."""
    try:
        import capstone  # only this bench needs it
    except ImportError as error:
        raise Failed("python3-capstone is not installed") from error
    decoder = capstone.Cs(capstone.CS_ARCH_X86, capstone.CS_MODE_64)
    decoder.detail = True
    found = Lines()
    without_access = {"lea", "nop", "prefetcht0", "prefetcht1", "prefetcht2", "prefetchnta"}
    for code, registers in _steps(trace):
        instruction = next(decoder.disasm(code, registers["rip"]))
        _touch(found.code, instruction.address, instruction.size)
        if instruction.mnemonic in {"push", "call"}:
            _touch(found.data, registers["rsp"] - 8, 8)
        elif instruction.mnemonic in {"pop", "ret"}:
            _touch(found.data, registers["rsp"], 8)
        elif instruction.mnemonic.startswith("rep"):
            raise Failed(f"{instruction.mnemonic}: instructions that repeat are not counted")
        if instruction.mnemonic in without_access:
            continue
        values = registers | {"rip": instruction.address + instruction.size}
        for operand in instruction.operands:
            if operand.type != capstone.CS_OP_MEM:
                continue
            place = operand.mem
            address = place.disp
            for register, factor in ((place.base, 1), (place.index, place.scale)):
                if register != 0:
                    address += factor * values[decoder.reg_name(register)]
            if place.segment != 0:
                address += values[decoder.reg_name(place.segment)]
            _touch(found.data, address & (2**64 - 1), operand.size)
    return found


def run(setting: Setting) -> Result:
    """Count by single-stepping a cycle of the executor's loop."""
    result = Result(
        "lines",
        "distinct cache lines of a cycle, from the end of the wait on",
        ["graph", "data", "code"],
    )
    for graph, title in _GRAPHS.items():
        command = [setting.program("instruction_count"), str(setting.library), graph, "trace"]
        found = lines_of(output_of(command))
        result.rows.append([title, float(len(found.data)), float(len(found.code))])
        if graph == "fig1":
            result.budgets.append(
                Budget("cache lines of data, Fig. 1", float(len(found.data)), 30.0, "lines")
            )
    return result
