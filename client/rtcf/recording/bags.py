"""Message types for rosbag, which is imported only on use."""

import importlib
import re
from typing import Any

from rtcf.recording.reader import RecordingError


class MessageType:
    """A message type without a generated class, for Bag.write."""

    def __init__(self, name: str, md5: str, definition: str) -> None:
        self._name, self._md5 = name, md5
        self._class = type(
            name.replace("/", "_"),
            (),
            {"_type": name, "_md5sum": md5, "_full_text": definition},
        )

    def raw(self, data: bytes) -> tuple[Any, ...]:
        """Return a serialised message for Bag.write(raw=True)."""
        return self._name, data, self._md5, None, self._class


def rosbag() -> Any:
    """Return the module rosbag; raises RecordingError if it is not installed."""
    return _module("rosbag", "python3-rosbag")


def time(nanoseconds: int) -> Any:
    """Return a time in ns for Bag.write."""
    return _module("genpy", "python3-genpy").Time(0, nanoseconds)


def require() -> None:
    """Raise RecordingError if md5_of needs a package that is not installed."""
    _module("genmsg", "python3-genmsg")


def md5_of(name: str, definition: str) -> str:
    """Return the MD5 sum of a type by its full definition, which includes its field types.

    Raises RecordingError if the definition is invalid.
    """
    genmsg = _module("genmsg", "python3-genmsg")
    gentools = _module("genmsg.gentools", "python3-genmsg")
    first, *others = re.split(r"^=+\n", definition, flags=re.MULTILINE)
    texts = {name: first}
    for text in others:
        head, _, body = text.partition("\n")
        texts[head.removeprefix("MSG:").strip()] = body
    try:
        context = genmsg.MsgContext.create_default()
        for each, text in texts.items():
            context.register(each, genmsg.msg_loader.load_msg_from_string(context, text, each))
        return str(gentools.compute_md5(context, context.get_registered(name)))
    except (KeyError, ValueError, genmsg.InvalidMsgSpec) as error:
        raise RecordingError(f"invalid definition of {name}: {error}") from None


def _module(name: str, package: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise RecordingError(f"bags need {name}: sudo apt install {package}") from None
