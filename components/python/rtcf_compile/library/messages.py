"""Adapters of ROS messages. g++ compiles one object file per message type, which does not depend on
the component. The user's cache keeps it beside the compiled components.
"""

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rtcf.component.message_type import MessageType
from rtcf_shared.folders import compiled_folder

from rtcf_compile.library import toolchain
from rtcf_compile.source.mistake import Mistake

_CPP = {"bool": "Bool", "float32": "Float", "float64": "Double"}
_FLAGS = (
    *("-std=c++17", "-O2", "-g1", "-DNDEBUG", "-fPIC", "-fvisibility=hidden", "-w"),
    "-fvisibility-inlines-hidden",
)


@dataclass(frozen=True)
class _Adapter:
    """An adapter that is being compiled."""

    message: MessageType
    object_file: Path
    part: Path
    source: Path
    process: "subprocess.Popen[str]"


def symbol(message: MessageType) -> str:
    """Return the symbol of the table of a message."""
    return f"rtcf_message_{message.name.replace('/', '__')}"


def objects(messages: Iterable[MessageType], folder: Path) -> list[Path]:
    """Return the object files of the adapters; compile those that are not in the cache.

    `folder`: used in place of a cache that is not writable. Raise Mistake if a message has no C++
    header, or if the header and the Python class differ.
    """
    by_name = {each.name: each for each in messages}
    kept, missing = _folder(folder), []
    files = []
    for message in by_name.values():
        file = kept / f"{message.name.replace('/', '-')}-{_key(message)}.o"
        files.append(file)
        if not _is_ours(file):
            missing.append((message, file))
    if missing:
        names = ", ".join(each.name for each, _ in missing)
        print(f"rtcf-compile: compiling {names} once", file=sys.stderr)
    for adapter in [_compile(message, file, folder) for message, file in missing]:
        _finish(adapter)
    return files


def _folder(other: Path) -> Path:
    """Return the cache of adapters, or another folder if it is not writable."""
    kept = compiled_folder() / ".messages"
    try:
        kept.mkdir(parents=True, exist_ok=True)
    except OSError:
        return other
    return kept if os.access(kept, os.W_OK) else other


def _is_ours(file: Path) -> bool:
    """Tell whether a file exists and only this user can write it."""
    try:
        found = file.stat()
    except OSError:
        return False
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def _key(message: MessageType) -> str:
    """Return a hash of everything that an adapter depends on."""
    header = toolchain.header(f"{message.name}.h")
    found = f"{header} {header.stat().st_mtime_ns}" if header else ""
    parts = (_source(message), found, *_command(), toolchain.identity())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _command() -> list[str]:
    here = Path(__file__).resolve().parent
    compiler = toolchain.compiler()
    # clang emits no unique symbols and rejects the option.
    more = [] if any("clang" in each for each in compiler) else ["-fno-gnu-unique"]
    return [*compiler, *_FLAGS, *more, f"-I{here}", *toolchain.flags(), "-c"]


def _compile(message: MessageType, file: Path, folder: Path) -> _Adapter:
    """Start to compile an adapter. _finish renames it into place atomically."""
    source = folder / f"{file.stem}.cpp"
    source.write_text(_source(message), encoding="utf-8")
    part = file.with_name(f".{file.name}.{os.getpid()}")
    process = subprocess.Popen(
        [*_command(), str(source), "-o", str(part)], stderr=subprocess.PIPE, text=True
    )
    return _Adapter(message, file, part, source, process)


def _finish(adapter: _Adapter) -> None:
    said = adapter.process.communicate()[1]
    if adapter.process.returncode != 0:
        adapter.part.unlink(missing_ok=True)
        raise _mistake(adapter.message, said)
    adapter.part.chmod(0o644)
    adapter.part.replace(adapter.object_file)


def _mistake(message: MessageType, said: str) -> Mistake:
    package = message.name.partition("/")[0]
    install = f"sudo apt install lib{package.replace('_', '-')}-dev, or build {package}"
    if f"{message.name}.h: No such file" in said:
        return Mistake(message.name, 0, "has no C++ header", install)
    if "rtcf-compile: another definition" in said:
        what = "the C++ header and the Python class have different definitions"
        return Mistake(message.name, 0, what, "build both from one message, source its workspace")
    return toolchain.mistake(message.name, said)


def _source(message: MessageType) -> str:
    """Return the C++ source of an adapter."""
    fields = [
        f"    RTCF_PYTHON_FIELD({'.'.join(each.path)}, {_scalar(each.type.scalar.name)}),"
        for each in message.leaves
    ]
    fields += [f"    RTCF_PYTHON_FIELD({'.'.join(each)}, UInt8)," for each in message.texts]
    table = f"const rtcf::python::MessageTable {symbol(message)}"
    return "\n".join(
        [
            f"#include <{message.name}.h>",
            "",
            '#include "message_adapter.hpp"',
            "",
            f"using Message = {message.cpp};",
            "using Sum = ros::message_traits::MD5Sum<Message>;",
            f"static_assert(Sum::static_value1 == 0x{message.md5[:16]}ULL &&",
            f"                  Sum::static_value2 == 0x{message.md5[16:]}ULL,",
            '              "rtcf-compile: another definition");',
            "constexpr rtcf::python::MessageField kFields[] = {",
            *fields,
            "    {}};",
            'extern "C" {',
            f"extern {table};",
            f"{table}{{&rtcf::typeInfo<Message>, kFields}};",
            "}",
            "",
        ]
    )


def _scalar(name: str) -> str:
    return _CPP.get(name) or name.replace("uint", "UInt").replace("int", "Int")
