"""A ROS node beside a loop; the tests start it as a program of its own.

peer.py record TOPIC       prints each std_msgs/Float64 it receives, exactly (hexadecimal)
peer.py latch TOPIC VALUE  publishes one std_msgs/Float64, latched

Both print `connected` when they have met a peer.
"""

import sys
import time
from typing import Any

import rospy
from std_msgs.msg import Float64

_POLL_S = 0.01


def _print(message: Any) -> None:
    # Messages come in bursts; flushed by _stay() instead of one by one.
    sys.stdout.write(f"{float(message.data).hex()}\n")


def _stay(peer: Any) -> None:
    while not rospy.is_shutdown() and peer.get_num_connections() == 0:
        time.sleep(_POLL_S)
    print("connected", flush=True)
    while not rospy.is_shutdown():
        time.sleep(_POLL_S)
        sys.stdout.flush()


def main() -> None:
    """Do what the command line says until the end of the node."""
    action, topic, *values = sys.argv[1:]
    rospy.init_node("peer", anonymous=True)
    if action == "record":
        _stay(rospy.Subscriber(topic, Float64, _print, tcp_nodelay=True))
    else:
        publisher = rospy.Publisher(topic, Float64, latch=True, queue_size=1)
        publisher.publish(float(values[0]))
        _stay(publisher)


if __name__ == "__main__":
    main()
