"""LLVM as this Debian has it, and what else of numba differs between the releases.

Debian 12: numba 0.56 on LLVM 14, whose pointers have types. Debian 13: numba 0.61 on LLVM 19, whose
have none, and whose passes are put together in another way. Nothing else here knows of that.
"""

import re
from typing import Any

import llvmlite.binding as llvm
import numba
from numba import types

POINTERS_HAVE_TYPES = llvm.llvm_version_info[0] < 15
_INLINED = 1000  # instructions
_POINTER = re.compile(r"(?:i\d+|\[\d+ x i\d+\])\*+")
_RECORD_AND_EXCEPTION = (
    r"\(i8\*\*[^,]*, (?P<exception>\{[^}]*\})\*\*[^,]*, (?P<record>\[[^\]]*\]\*)"
)

# Neither numba takes an array of bools in a record, for want of this alone.
types.Boolean.bitwidth = 8
if POINTERS_HAVE_TYPES:
    llvm.initialize()
llvm.initialize_native_target()
llvm.initialize_native_asmprinter()


def parsed(assembly: str) -> Any:
    """Return the module of an assembly."""
    return llvm.parse_assembly(assembly)


def pointers(assembly: str) -> str:
    """Return assembly of ours, whose pointers have types, as this LLVM reads it."""
    return assembly if POINTERS_HAVE_TYPES else _POINTER.sub("ptr", assembly)


def taken(assembly: str, function: str) -> tuple[str, str]:
    """Return as what a function of numba's takes the record and the exception's place."""
    form = _RECORD_AND_EXCEPTION if POINTERS_HAVE_TYPES else r"\(ptr [^,]*, ptr [^,]*, ptr "
    found = re.search(rf"^define [^\n]*@{re.escape(function)}{form}", assembly, re.M)
    if found is None:
        raise RuntimeError(f"numba {numba.__version__}: functions have a form not known here")
    return (found["record"], f"{found['exception']}**") if POINTERS_HAVE_TYPES else ("ptr", "ptr")


def drop_unused(module: Any) -> None:
    """Drop what no external function needs."""
    if POINTERS_HAVE_TYPES:
        passes = llvm.ModulePassManager()
        passes.add_global_dce_pass()
        passes.run(module)
    else:
        passes = llvm.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(module, _builder())


def optimise(module: Any) -> None:
    """Make a module as fast as -O3 does, inlining more than that."""
    if POINTERS_HAVE_TYPES:
        passes = llvm.ModulePassManager()
        builder = llvm.PassManagerBuilder()
        builder.opt_level = 3
        builder.loop_vectorize = True
        builder.slp_vectorize = True
        builder.inlining_threshold = _INLINED
        target = machine()  # the passes refer to it
        target.add_analysis_passes(passes)
        builder.populate(passes)
        passes.run(module)
    else:
        builder = _builder()
        builder.getModulePassManager().run(module, builder)
    drop_unused(module)


def emitted(assembly: str) -> bytes:
    """Return the object file of an assembly that is only data and calls."""
    module = parsed(assembly)
    target = machine()
    module.triple, module.data_layout = target.triple, str(target.target_data)
    module.verify()
    return bytes(target.emit_object(module))


def machine() -> Any:
    """Return what emits code for any processor of this architecture."""
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu="generic", opt=3, reloc="pic", codemodel="default")


def _builder() -> Any:
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = True
    tuning.slp_vectorization = True
    tuning.inlining_threshold = _INLINED
    return llvm.create_pass_builder(machine(), tuning)
