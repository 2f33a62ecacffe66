"""Image files: their formats, and writing plots of Matplotlib."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcf_shared import whole_files


def require_format(file: Path, formats: Sequence[str]) -> None:
    """Raise ValueError for another suffix than those of `formats`, e.g. ".svg"."""
    if file.suffix not in formats:
        raise ValueError(f"{file}: use one of {', '.join(formats)}")


def pyplot_module() -> Any:
    """Return Matplotlib's pyplot, imported at its first use; raises RtcfError."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        raise rtcf.RtcfError("Matplotlib not found: sudo apt install python3-matplotlib") from None
    return pyplot


def write(figure: Any, file: Path) -> None:
    """Write a figure in the format of the file's suffix, and close it; raises RtcfError."""
    pyplot = pyplot_module()
    content = io.BytesIO()
    # Text in an SVG file remains text, which can be searched.
    with pyplot.rc_context({"svg.fonttype": "none"}):
        figure.savefig(content, dpi=150, format=file.suffix.removeprefix("."))
    pyplot.close(figure)
    try:
        whole_files.write_named(file, content.getvalue())
    except OSError as error:
        raise rtcf.RtcfError(f"{file}: {error.strerror or error}") from None
