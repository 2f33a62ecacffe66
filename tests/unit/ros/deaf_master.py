#!/usr/bin/python3
"""A ROS master that stops answering: it never replies to registerPublisher.

deaf_master.py PORT   prints `asked` when a topic is registered; the test ends it
"""

import socketserver
import sys
import threading
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer


class DeafMaster(socketserver.ThreadingMixIn, SimpleXMLRPCServer):
    """Detects the node by the service that it registers."""

    daemon_threads = True
    node = ""

    def _dispatch(self, method: str, params: Any) -> Any:
        if method == "registerPublisher":
            sys.stdout.write("asked\n")  # a single write, since several threads print
            sys.stdout.flush()
            threading.Event().wait()
        if method == "registerService":
            self.node = params[3]
        if method == "lookupNode":
            return [1, "", self.node]
        if method == "hasParam":
            return [1, "", False]
        return [-1 if method == "getParam" else 1, "", 0]


DeafMaster(("127.0.0.1", int(sys.argv[1])), logRequests=False).serve_forever()
