"""Extraction of the places that raise from LLVM's assembly."""

import pickle

import pytest
from llvmlite import binding, ir
from rtcf_compile.machine_code.raises import hash_of, raises_in

FILE = "/some/where/controller.py"


def assembly(**constants: bytes) -> str:
    """Return a module with such constants, in numba's format."""
    module = ir.Module()
    for name, data in constants.items():
        kind = ir.ArrayType(ir.IntType(8), len(data))
        constant = ir.GlobalVariable(module, kind, f".const.pickledata.{name}")
        constant.global_constant = True
        constant.initializer = ir.Constant(kind, bytearray(data))
    return str(binding.parse_assembly(str(module)))


def place(text: str, line: int = 7) -> bytes:
    return pickle.dumps((ValueError, (text,), ("update", FILE, line)), protocol=4)


@pytest.mark.parametrize("length", range(0, 256, 5))
def test_any_text_is_read_exactly(length: int) -> None:
    # Lengths occur in the bytes, too, and LLVM escapes some of them.
    text = "".join(chr(32 + (each + length) % 95) for each in range(length)) + "\\ \\5c \\\\"
    data = place(text)
    (found,) = raises_in(assembly(x1=data).replace("x1", "1"), FILE).items()
    assert found[0] == hash_of(data)
    assert (found[1].line, found[1].text) == (7, f"ValueError: {text}")


@pytest.mark.parametrize("first", [0x95, 0x80, 0x2E, 0x8A, 0x94, 0x68])
def test_a_hash_is_not_read_as_a_place(first: int) -> None:
    # Next to each constant is its hash, whose bytes are arbitrary.
    data, other = place("too much"), bytes([first]) + b"\xff" * 19
    text = assembly(x1=data, x2=other).replace("pickledata.x1", "pickledata.1")
    found = raises_in(text.replace("pickledata.x2", "pickledata.1.sha1"), FILE)
    assert [each.text for each in found.values()] == ["ValueError: too much"]
