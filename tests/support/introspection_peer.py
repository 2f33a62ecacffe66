"""A ROS node that receives a runner's introspection topics; the tests start it.

introspection_peer.py cycles TOPIC COUNT      prints `connected`, then iteration, stamp, latency
                                              and duration (ns) of COUNT cycles
introspection_peer.py info TOPIC COUNT        the same for RTCF 2021's messages: stamp, duration
introspection_peer.py stamped TOPIC COUNT     stamp (ns) and value of COUNT rtcf_msgs/Int32Stamped
introspection_peer.py diagnostics NAME LEVEL  prints all statuses until NAME has LEVEL, as
                                              name|level|message|key=value|...
"""

import sys
import threading
from collections.abc import Callable
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rtcf_msgs.msg import Cycle, Int32Stamped, IterationInfo

_POLL_S = 0.01
_DEADLINE_S = 60.0
_KINDS = {"cycles": Cycle, "info": IterationInfo, "stamped": Int32Stamped}
_TEXT = {
    Cycle: lambda each: (
        f"{each.iteration} {each.header.stamp.to_nsec()} {each.latency_ns} {each.duration_ns}"
    ),
    IterationInfo: lambda each: f"{each.stamp.to_nsec()} {each.duration_ns}",
    Int32Stamped: lambda each: f"{each.header.stamp.to_nsec()} {each.data}",
}


def _cycles(topic: str, kind: Any, count: int) -> None:
    cycles: list[str] = []
    full = threading.Event()

    def take(message: Any) -> None:
        if len(cycles) < count:
            text: Callable[[Any], str] = _TEXT[kind]
            cycles.append(text(message))
        else:
            full.set()

    peer = rospy.Subscriber(topic, kind, take, tcp_nodelay=True)

    def met() -> bool:
        # rospy also counts connections that it has not established yet. The publisher's header,
        # which contains its name, arrives once it has accepted the connection.
        return any(each.callerid_pub != "unknown" for each in peer.impl.connections)

    while not met() and not rospy.is_shutdown():
        full.wait(_POLL_S)
    print("connected", flush=True)
    if not full.wait(_DEADLINE_S):
        sys.exit(f"only {len(cycles)} cycles")
    print("\n".join(cycles))


def _diagnostics(name: str, level: int) -> None:
    found = threading.Event()

    def take(message: Any) -> None:
        for status in message.status:
            if found.is_set():
                return
            pairs = [f"{pair.key}={pair.value}" for pair in status.values]
            # A single write, since several threads receive statuses.
            line = "|".join([status.name, str(status.level), status.message, *pairs])
            sys.stdout.write(f"{line}\n")
        found_now = any(each.name == name and each.level == level for each in message.status)
        if found_now:
            found.set()

    rospy.Subscriber("/diagnostics", DiagnosticArray, take)
    if not found.wait(_DEADLINE_S):
        sys.exit(f"{name} never had level {level}")


def main() -> None:
    """Run the command of the command line."""
    action, what, number = sys.argv[1:]
    rospy.init_node("introspection_peer", anonymous=True)
    if action in _KINDS:
        _cycles(what, _KINDS[action], int(number))
    else:
        _diagnostics(what, int(number))
    sys.stdout.flush()
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    main()
