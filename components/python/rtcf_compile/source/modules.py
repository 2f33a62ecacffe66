"""The source of a component: runs a module once in Python, and reads its functions."""

import ast
import hashlib
import importlib.util
import inspect
import linecache
import pickle
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType, ModuleType

from rtcf.component import Component, DeclarationError

from rtcf_compile.source import (
    dependencies,
    lifting,
    numpy_errors,
    objects,
    processor_time,
    progress,
)
from rtcf_compile.source.mistake import Mistake, source_line
from rtcf_compile.source.parsed import is_of_user, parsed
from rtcf_compile.source.prefix_map import mapped
from rtcf_compile.source.scopes import everywhere


@dataclass(frozen=True)
class Source:
    """A function of the user: its syntax tree, with the line numbers of its file."""

    function: FunctionType
    tree: ast.FunctionDef
    file: str
    # The functions that were nested in it, by the names by which it calls them.
    lifted: Mapping[str, FunctionType] = field(default_factory=dict)
    variables: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        """Find the variables and arguments, before the tree is rewritten."""
        object.__setattr__(self, "variables", everywhere(self.tree))


# Trees of functions, whose callers rewrite their own copies, and the functions nested in them.
_read: dict[FunctionType, tuple[bytes, Mapping[str, FunctionType]]] = {}


def load(file: Path) -> ModuleType:
    """Run a module in Python and return it; raise Mistake on failure."""
    file = file.resolve()
    try:
        path = mapped(str(file)).encode()
    except UnicodeEncodeError:
        raise Mistake(str(file), 0, "its path is not UTF-8", "rename the file") from None
    progress.note(str(file), 0)
    name = f"rtcf_source_{hashlib.sha256(path).hexdigest()[:8]}_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise Mistake(str(file), 0, "no such Python file", "give the path of a .py file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    sys.path.insert(0, str(file.parent))
    try:
        with dependencies.recorded(), processor_time.limited(processor_time.MODULE_S):
            spec.loader.exec_module(module)
    except Mistake:
        raise
    except processor_time.TimeLimitError as error:
        line = processor_time.loop_line(error, str(file))
        what = f"the module takes more than {processor_time.MODULE_S:.0f} s of processor time"
        raise Mistake(str(file), line, what, "end its loops, or compute less here") from None
    except SystemExit as error:
        line = _line_in(file, error)
        remedy = 'remove it, or write it below if __name__ == "__main__":'
        raise Mistake(str(file), line, "the module ends Python", remedy) from None
    except SyntaxError as error:
        raise Mistake(
            str(error.filename or file), error.lineno or 0, str(error.msg), "correct the syntax"
        ) from None
    except DeclarationError as error:
        raise Mistake(str(file), _line_in(file, error), *_parts(str(error))) from None
    except Exception as error:
        line = _line_in(file, error)
        if isinstance(error, ModuleNotFoundError) and error.name == "rtcf.signal":
            remedy = "write from rtcf.linear import …"
            raise Mistake(str(file), line, "rtcf.signal is now rtcf.linear", remedy) from None
        if isinstance(error, ImportError) and (found := _moved(error)):
            raise Mistake(str(file), line, *found) from None
        what = f"{type(error).__name__}: {error}"
        if found := numpy_errors.explained(error, source_line(str(file), line)):
            what = found[0]
        raise Mistake(str(file), line, what, "make the module run as Python first") from None
    finally:
        sys.path.pop(0)
    return module


def components(module: ModuleType) -> list[type[Component]]:
    """Return the component classes that a module defines, in source order, without `_Name`."""
    found = [
        each
        for each in vars(module).values()
        if isinstance(each, type)
        and issubclass(each, Component)
        and each.__module__ == module.__name__
        and not each.__name__.startswith("_")
    ]
    bases = {base for each in found for base in each.__mro__[1:]}
    # A base class without update, or with a method that subclasses must define, is not a component.
    whole = [each for each in found if each not in bases or not _is_abstract(each)]
    _check_names(module, found)
    return sorted(dict.fromkeys(whole), key=lambda each: inspect.getsourcelines(each)[1])


def _is_abstract(cls: type[Component]) -> bool:
    """Tell whether subclasses must define update, or a method that raises NotImplementedError."""
    if cls.update is Component.update:
        return True
    functions = [each for name in dir(cls) if isinstance(each := getattr(cls, name), FunctionType)]
    return any(_is_missing(each) for each in functions if is_of_user(each))


def _is_missing(function: FunctionType) -> bool:
    if "NotImplementedError" not in function.__code__.co_names:
        return False
    first, *rest = parsed(function).body
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and rest:
        first, *rest = rest
    raised = first.exc if isinstance(first, ast.Raise) else None
    raised = raised.func if isinstance(raised, ast.Call) else raised
    return isinstance(raised, ast.Name) and raised.id == "NotImplementedError" and not rest


def _check_names(module: ModuleType, found: Sequence[type]) -> None:
    """Reject two classes of one name: the second would hide the first."""
    file = module.__file__ or "?"
    tree = ast.parse("".join(linecache.getlines(file)))
    for name in {each.__name__ for each in found}:
        defined = [
            each for each in tree.body if isinstance(each, ast.ClassDef) and each.name == name
        ]
        # The first may have another name by now: Other = Base.
        if len(defined) > len({each for each in found if each.__name__ == name}):
            raise Mistake(file, defined[-1].lineno, f"{name} is defined twice", "rename one")


def read(function: FunctionType, is_whole: bool = False) -> Source:
    """Return the syntax tree of a function. `is_whole`: with the functions nested in it."""
    file = inspect.getsourcefile(function.__code__) or "?"
    if is_whole:
        return Source(function, lifting.tree_of(function) or parsed(function), file)
    if function not in _read:
        known = lifting.tree_of(function)
        tree = known or parsed(function)
        called = {} if known else objects.replace(tree, function, file)
        lifted = lifting.lift(tree, function, file, called)
        # Pickle copies a tree in a fifth of the time of deepcopy.
        _read[function] = pickle.dumps(tree), lifted
    data, functions = _read[function]
    return Source(function, pickle.loads(data), file, functions)


def _moved(error: ImportError) -> tuple[str, str] | None:
    """Return the error and the remedy for a name that is in a module of the imported package."""
    name, package = getattr(error, "name_from", None), error.name or ""
    if found := re.match(r"cannot import name '(\w+)' from '([\w.]+)'", str(error)):
        name, package = found[1], found[2]
    if package.endswith("_msgs"):
        return f"{package} has no {name}", f"write from {package}.msg import {name}"
    if package == "rtcf":
        return f"rtcf has no {name}", f"write from rtcf.component import {name}"
    return None


def _parts(text: str) -> tuple[str, str]:
    """Split the message of a DeclarationError into the error and the remedy."""
    what, _, remedy = text.rpartition(": ")
    return what, remedy


def _line_in(file: Path, error: BaseException) -> int:
    line, trace = 0, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line
