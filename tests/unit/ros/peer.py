#!/usr/bin/python3
"""A ROS node on the other side of a test's topics; the test starts and ends it.

peer.py listen TOPIC TYPE   prints the value of each message, of a stamped one its stamp (ns) before
peer.py send TOPIC VALUE    publishes one latched std_msgs/Float64 and stays
peer.py health TOPIC        prints `name|message` of each diagnostic status
peer.py count TOPIC         publishes 1.0, 2.0, ... as std_msgs/Float64, 20 a second
peer.py node NAME           only has that name; ends when its master says so
peer.py loggers NODE        does what rqt_logger_level does to a node, prints `done` and ends
"""

import contextlib
import os
import sys
from typing import Any

import diagnostic_msgs.msg
import roscpp.srv
import rospy
import std_msgs.msg
from roslib.message import get_message_class


def show(message: Any) -> None:
    """Prints a message's value on a line of its own."""
    stamp = f"{message.header.stamp.to_nsec()} " if message._has_header else ""
    # In one piece: each publisher is heard by a thread of its own.
    sys.stdout.write(f"{stamp}{message.data}\n")
    sys.stdout.flush()


def show_health(message: Any) -> None:
    """Prints each status on a line of its own."""
    sys.stdout.write("".join(f"{each.name}|{each.message}\n" for each in message.status))
    sys.stdout.flush()


def look_at_loggers(node: str) -> None:
    """Asks for the loggers of a node and sets the level of one."""
    with contextlib.suppress(rospy.ServiceException):  # it may refuse
        rospy.ServiceProxy(f"{node}/get_loggers", roscpp.srv.GetLoggers)()
    rospy.ServiceProxy(f"{node}/set_logger_level", roscpp.srv.SetLoggerLevel)("ros", "debug")
    print("done", flush=True)


def main() -> None:
    """Does what the command line says until it is killed."""
    action, argument = sys.argv[1:3]
    if action == "node":
        namespace, _, name = argument.rpartition("/")
        os.environ["ROS_NAMESPACE"] = namespace
        # rospy reads it when it is imported.
        rospy.names._set_caller_id(argument)
        rospy.init_node(name, disable_signals=True)
    else:
        rospy.init_node("peer", anonymous=True, disable_signals=True)
    if action == "listen":
        rospy.Subscriber(argument, get_message_class(sys.argv[3]), show, tcp_nodelay=True)
    if action == "health":
        rospy.Subscriber(argument, diagnostic_msgs.msg.DiagnosticArray, show_health)
    if action == "send":
        publisher = rospy.Publisher(argument, std_msgs.msg.Float64, latch=True, queue_size=1)
        publisher.publish(float(sys.argv[3]))
    if action == "count":
        publisher = rospy.Publisher(argument, std_msgs.msg.Float64, queue_size=1)
        value = 0.0
        while not rospy.is_shutdown():
            value += 1.0
            publisher.publish(value)
            rospy.sleep(0.05)
    if action == "loggers":
        look_at_loggers(argument)
        return
    if action == "node":
        print("ready", flush=True)
    rospy.spin()


main()
