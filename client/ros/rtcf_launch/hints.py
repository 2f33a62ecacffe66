"""Commands in messages of rtcfd, changed to fit a launch.

rtcfd and its executors advise to use rtcfctl.  The settings of a launch's runner are parameters of
rt_runner, and other commands must name the socket of a private rtcfd.
"""

import re

# rt_runner's parameters, by the options of `rtcfctl runner set` that messages name.
_PARAMETERS = {
    "blacklist": "ros_mapping_blacklist",
    "cpu": "cpu",
    "frequency": "frequency",
    "largest-message": "ros_largest_message_kB",
    "lock-memory": "lock_memory",
    "realtime": "realtime",
    "ros-peers": "ros_peers",
}
_SETTING = re.compile(r"(?<!`)rtcfctl (?:-r \S+ )?runner set (?:\w+ )?--([a-z-]+)")
_COMMAND = re.compile(r"\brtcfctl (?=[a-z-])")
_BREAK = re.compile(r"`rtcfctl break((?: [^\s`.]+\.[^\s`.]+)+)`")
_LOADING = re.compile(r"loading (\S+) with `--break[^`]*`")
_IGNORE = "~topics_ignore_for_graph or ~is_first of"


def fitted(text: str, socket: str) -> str:
    """Return a message with commands for a launch whose rtcfd has a private socket; empty = the
    launch uses the system's rtcfd."""
    text = _BREAK.sub(_ignoring, text)
    text = _LOADING.sub(rf"{_IGNORE} \1", text)
    text = _SETTING.sub(_parameter, text)
    return _COMMAND.sub(f"rtcfctl --socket {socket} ", text) if socket else text


def _parameter(found: re.Match[str]) -> str:
    name = _PARAMETERS.get(found[1])
    return f"rt_runner's ~{name}" if name else found[0]


def _ignoring(found: re.Match[str]) -> str:
    components = dict.fromkeys(each.rpartition(".")[0] for each in found[1].split())
    return f"{_IGNORE} {', '.join(components)}"
