"""A ROS node that communicates with a loop; the tests start it as a separate program.

peer.py record TOPIC       prints each std_msgs/Float64 it receives, exactly (hexadecimal)
peer.py latch TOPIC VALUE  publishes one std_msgs/Float64, latched
peer.py told TOPIC         publishes each number of its input as std_msgs/Float64, latched; the line
                           `drop` closes its connections, like a network that fails
peer.py released TOPIC     publishes one std_msgs/Bool, false and latched, like the button of a stop
peer.py text TOPIC SIZE    publishes one std_msgs/String of SIZE characters, latched
peer.py sizes TOPIC        prints the length in characters of each std_msgs/String it receives
peer.py numbers TOPIC       prints each std_msgs/Int32 it receives
peer.py count TOPIC         prints 0 for each std_msgs/Int64 it receives
peer.py rosout NODE        prints each record that NODE publishes on /rosout, as JSON
peer.py any TOPIC...       receives messages of any type of all these topics

peer.py console LOGGER      prints each record of a logger, as JSON, from rqt_console's topic
peer.py graph               prints once, as JSON, the connections that rqt_graph draws
peer.py tune NODE CHANGE    changes a node's parameters (a JSON object) as rqt_reconfigure does;
                            prints, as JSON, their descriptions, and the values at each change

The others print `connected` when they are connected to their peers.
"""

import json
import os
import sys
import threading
import time
from typing import Any

import dynamic_reconfigure
import dynamic_reconfigure.client
import rosgraph.impl.graph
import rospy
from rosgraph_msgs.msg import Log
from std_msgs.msg import Bool, Float64, Int32, Int64, String

_POLL_S = 0.01


def _print(message: Any) -> None:
    # A single write, since several threads call this: print() writes the newline separately.
    # Messages come in bursts; _stay() flushes them together.
    sys.stdout.write(f"{float(message.data).hex()}\n")


def _print_size(message: Any) -> None:
    sys.stdout.write(f"{float(len(message.data)).hex()}\n")


def _print_record(message: Any, node: str) -> None:
    if message._connection_header["callerid"] != node:
        return
    record = {key: getattr(message, key) for key in ("level", "name", "msg", "file", "line",
                                                         "function", "topics")}  # fmt: skip
    record["stamp"] = message.header.stamp.to_sec()
    sys.stdout.write(json.dumps(record) + "\n")


def _print_of_logger(message: Any, logger: str) -> None:
    if message.name == logger:
        sys.stdout.write(json.dumps({"level": message.level, "msg": message.msg}) + "\n")


def _graph() -> None:
    graph = rosgraph.impl.graph.Graph()
    graph.update()
    edges = sorted([edge.start, edge.label, edge.end] for edge in graph.nn_edges)
    sys.stdout.write(json.dumps({"bad": sorted(graph.bad_nodes), "edges": edges}) + "\n")
    sys.stdout.flush()


def _tune(node: str, change: str) -> None:
    def show(**what: Any) -> None:
        sys.stdout.write(json.dumps(what) + "\n")
        sys.stdout.flush()

    def show_values(values: Any) -> None:
        show(values={name: value for name, value in values.items() if name != "groups"})

    def show_description(description: Any) -> None:
        show(described={each["name"]: each["type"] for each in description})

    show(found=dynamic_reconfigure.find_reconfigure_services())
    client = dynamic_reconfigure.client.Client(
        node, config_callback=show_values, description_callback=show_description
    )
    client.update_configuration(json.loads(change))
    rospy.spin()


def _connections(peer: Any, publisher: str = "") -> int:
    """Return the number of established connections; for a subscriber, to `publisher` if named."""
    if isinstance(peer, rospy.Publisher):
        return int(peer.get_num_connections())
    # rospy also counts connections that it has not established yet. The publisher's header, which
    # contains its name, arrives once it has accepted the connection.
    met = [each.callerid_pub for each in peer.impl.connections if each.callerid_pub != "unknown"]
    return sum(not publisher or name == publisher for name in met)


def _stay(*peers: Any, publisher: str = "") -> None:
    while not rospy.is_shutdown() and any(_connections(peer, publisher) == 0 for peer in peers):
        time.sleep(_POLL_S)
    sys.stdout.write("connected\n")
    while not rospy.is_shutdown():
        sys.stdout.flush()
        time.sleep(_POLL_S)
    sys.stdout.flush()
    # Immediately: Python would abort on threads that still write.
    os._exit(0)


def _do_as_told(publisher: rospy.Publisher) -> None:
    for line in sys.stdin:
        if line == "drop\n":
            for connection in list(publisher.impl.connections):
                connection.close()
        else:
            publisher.publish(float(line))


def main() -> None:
    """Run the command of the command line until the end of the node."""
    action, topic, *values = sys.argv[1:] if len(sys.argv) > 2 else [sys.argv[1], ""]
    publisher: Any
    rospy.init_node("peer", anonymous=True)
    if action == "record":
        _stay(rospy.Subscriber(topic, Float64, _print, tcp_nodelay=True))
    elif action == "numbers":
        _stay(rospy.Subscriber(topic, Int32, _print, tcp_nodelay=True))
    elif action == "sizes":
        _stay(rospy.Subscriber(topic, String, _print_size, tcp_nodelay=True))
    elif action == "count":
        _stay(rospy.Subscriber(topic, Int64, lambda _: sys.stdout.write("0x0p0\n")))
    elif action == "rosout":
        # Every node publishes on /rosout, including this one.
        records = rospy.Subscriber("/rosout", Log, _print_record, topic, tcp_nodelay=True)
        _stay(records, publisher=topic)
    elif action == "console":
        _stay(rospy.Subscriber("/rosout_agg", Log, _print_of_logger, topic))
    elif action == "graph":
        _graph()
    elif action == "tune":
        _tune(topic, values[0])
    elif action == "any":
        _stay(*(rospy.Subscriber(each, rospy.AnyMsg) for each in [topic, *values]))
    elif action == "told":
        publisher = rospy.Publisher(topic, Float64, latch=True, queue_size=1)
        threading.Thread(target=_do_as_told, args=(publisher,), daemon=True).start()
        _stay(publisher)
    elif action == "released":
        publisher = rospy.Publisher(topic, Bool, latch=True, queue_size=1)
        publisher.publish(False)
        _stay(publisher)
    elif action == "text":
        publisher = rospy.Publisher(topic, String, latch=True, queue_size=1)
        publisher.publish("x" * int(values[0]))
        _stay(publisher)
    else:
        publisher = rospy.Publisher(topic, Float64, latch=True, queue_size=1)
        publisher.publish(float(values[0]))
        _stay(publisher)


if __name__ == "__main__":
    main()
