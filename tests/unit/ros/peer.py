#!/usr/bin/python3
"""A ROS node at the other end of a test's topics; the test starts and ends it.

peer.py listen TOPIC TYPE   prints the value of each message, after its stamp (ns) if it has one
peer.py send TOPIC VALUE    publishes one latched std_msgs/Float64 and stays
peer.py health TOPIC        prints `name|message` of each diagnostic status
peer.py count TOPIC         publishes 1.0, 2.0, ... as std_msgs/Float64, 20 per second
peer.py node NAME           only has that name; ends when its master asks it to
peer.py loggers NODE        calls a node like rqt_logger_level, prints `done` and ends
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
    """Print a message's value on its own line."""
    stamp = f"{message.header.stamp.to_nsec()} " if message._has_header else ""
    # A single write: messages of each publisher arrive in a separate thread.
    sys.stdout.write(f"{stamp}{message.data}\n")
    sys.stdout.flush()


def show_health(message: Any) -> None:
    """Print each status on its own line."""
    sys.stdout.write("".join(f"{each.name}|{each.message}\n" for each in message.status))
    sys.stdout.flush()


def look_at_loggers(node: str) -> None:
    """Query the loggers of a node and set the level of one."""
    with contextlib.suppress(rospy.ServiceException):  # it may fail
        rospy.ServiceProxy(f"{node}/get_loggers", roscpp.srv.GetLoggers)()
    rospy.ServiceProxy(f"{node}/set_logger_level", roscpp.srv.SetLoggerLevel)("ros", "debug")
    print("done", flush=True)


def main() -> None:
    """Run the command of the command line until the process is killed."""
    action, argument = sys.argv[1:3]
    if action == "node":
        namespace, _, name = argument.rpartition("/")
        os.environ["ROS_NAMESPACE"] = namespace
        # rospy reads it at import time.
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
