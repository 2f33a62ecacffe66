"""Limits the processor time of Python code, with a timer signal.

A limit of processor time gives the same result on a busy machine; a limit of wall time would not.
"""

import ast
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

HOOK_S = 2.0  # limit of one hook, thousands of times a typical period
MODULE_S = 30.0  # limit of a module, which may compute tables


class TimeLimitError(BaseException):
    """The limit is exceeded. A BaseException, so that components cannot catch it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TimeLimitError if the Python code in the context takes longer.

    Works in the main thread only, where Python runs signal handlers; other threads have no limit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGVTALRM, _over)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def loop_line(error: BaseException, file: str) -> int:
    """Return the line of the loop in which code of a file was interrupted, else that line."""
    line, trace = 0, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    return enclosing_loop(file, line)


def enclosing_loop(file: str, line: int) -> int:
    """Return the line of the innermost `while` around a line, else of the outermost `for`, else the
    line itself.
    """
    try:
        tree = ast.parse(Path(file).read_bytes())
    except (OSError, SyntaxError, ValueError):
        return line
    around = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.While | ast.For) and node.lineno <= line <= (node.end_lineno or 0)
    ]
    loops = sorted(around, key=lambda node: node.lineno)
    endless = [node for node in loops if isinstance(node, ast.While)]
    return (endless[-1:] or loops)[0].lineno if loops else line


def _over(number: int, frame: FrameType | None) -> None:
    raise TimeLimitError
