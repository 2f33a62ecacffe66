"""The clock of a simulation; the tests start it as a separate program.

clock_peer.py tick      publishes a tick on /clock for each line of its input, in ns
clock_peer.py record    prints each tick of /clock that it receives, in ns

Both print `connected`: `tick` when all subscribers are connected (/rosout is one of them),
`record` when it is connected to a clock.
"""

import sys
import time

import rosgraph
import rospy
from rosgraph_msgs.msg import Clock

_POLL_S = 0.01


def _say(line: object) -> None:
    # A single write, since several threads call this.
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _tick() -> None:
    publisher = rospy.Publisher("/clock", Clock, queue_size=100000)
    while publisher.get_num_connections() < max(1, _subscribers()):
        time.sleep(_POLL_S)
    _say("connected")
    for line in sys.stdin:
        publisher.publish(Clock(clock=rospy.Time(0, int(line))))


def _subscribers() -> int:
    _, subscribed, _ = rosgraph.Master("/clock_peer").getSystemState()
    return sum(len(nodes) for topic, nodes in subscribed if topic == "/clock")


def _record() -> None:
    subscriber = rospy.Subscriber("/clock", Clock, lambda tick: _say(tick.clock.to_nsec()))
    while not rospy.is_shutdown() and subscriber.get_num_connections() == 0:
        time.sleep(_POLL_S)
    _say("connected")
    while not rospy.is_shutdown():
        time.sleep(_POLL_S)


if __name__ == "__main__":
    rospy.init_node("clock_peer", anonymous=True, disable_rostime=True)
    if sys.argv[1] == "tick":
        _tick()
    else:
        _record()
