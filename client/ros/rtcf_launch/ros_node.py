"""A ROS node without rospy: rosnode list, info, ping and kill work with it, and a second node of
the same name displaces it.  A node of rospy would wait for a master at its end.

It has no topics.  Its services are the logger services that every node has.  After a restart of
the master, the node registers again.
"""

import os
import socket
import threading
import time
import urllib.parse
from collections.abc import Callable
from socketserver import ThreadingMixIn
from typing import Any
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from rtcf_launch.logger_services import LoggerServices
from rtcf_launch.master import Master, MasterSilent

_LARGEST_CALL = 64 * 1024  # bytes
_POLL_S = 0.1
_CHECK_S = 1.0  # between two checks of the registration
_PROBE_S = 1.0


class _Handler(SimpleXMLRPCRequestHandler):
    rpc_paths = ()  # any

    def do_POST(self) -> None:
        """Answer a call; reject one that is longer than any call of a master."""
        try:
            size = int(self.headers.get("content-length", ""))
        except ValueError:
            size = _LARGEST_CALL + 1
        if size > _LARGEST_CALL:
            self.send_error(413)
        else:
            super().do_POST()


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True

    def handle_error(self, *_: Any) -> None:
        """Ignore callers that disconnect early."""


class RosNode:
    """The node.  The main thread owns it; its own threads answer calls."""

    def __init__(
        self,
        master: Master,
        name: str,
        hostname: str,
        ended: Callable[[str], None],
        level_set: Callable[[str], None],
    ) -> None:
        """Start to answer calls; register() makes the node known.

        ended      called by any thread, when a ROS peer wants the node to end
        level_set  called by any thread, when a ROS peer sets the level of its logger
        """
        self._master = master
        self._name = name
        self._ended = ended
        host = hostname or socket.gethostname()
        self._server = _Server(("", 0), requestHandler=_Handler, logRequests=False, allow_none=True)
        self._services = LoggerServices(name, level_set)
        self._ending = threading.Event()
        self._uri = f"http://{host}:{self._server.server_address[1]}/"
        self._service_uri = f"rosrpc://{host}:{self._services.port}"
        for call, answer in self._calls().items():
            self._server.register_function(answer, call)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def register(self) -> str:
        """Register the node; return the URI of the node that had its name; empty = none."""
        before = self._master.node_uri(self._name)
        self._register()
        return "" if before == self._uri else before

    def stay_registered(self, back: Callable[[], None]) -> None:
        """Start a thread that registers the node again whenever the master has lost it, and then
        calls `back`.  If another node has the name, it does nothing."""
        threading.Thread(target=self._stay_registered, args=(back,), daemon=True).start()

    def _register(self) -> None:
        for service in self._services.names:
            self._master.register_service(service, self._service_uri, self._uri)

    def _stay_registered(self, back: Callable[[], None]) -> None:
        while not self._ending.wait(_CHECK_S):
            try:
                if self._master.node_uri(self._name) or self._ending.is_set():
                    continue
                self._register()
            except MasterSilent:
                continue
            back()

    def end(self, master: Master) -> None:
        """Withdraw all registrations and end; `master` needs a short timeout."""
        self._ending.set()
        try:
            for service in self._services.names:
                master.unregister_service(service, self._service_uri)
        except MasterSilent:
            pass
        self._server.shutdown()
        self._server.server_close()
        self._services.end()

    def _calls(self) -> dict[str, Callable[..., Any]]:
        def shutdown(_: str, why: str = "") -> Any:
            self._ended(why or "a ROS node requested a shutdown")
            return [1, "shutting down", 0]

        return {
            "shutdown": shutdown,
            "getPid": lambda _: [1, "", os.getpid()],
            "getMasterUri": lambda _: [1, "", self._master.uri],
            "getBusStats": lambda _: [1, "", [[], [], []]],
            "getBusInfo": lambda _: [1, "", []],
            "getSubscriptions": lambda _: [1, "", []],
            "getPublications": lambda _: [1, "", []],
            "paramUpdate": lambda *_: [1, "", 0],
            "publisherUpdate": lambda *_: [1, "", 0],
            "requestTopic": lambda *_: [0, f"{self._name} publishes nothing", 0],
        }


def wait_until_gone(uri: str, pause: Callable[[float], bool], limit_s: float) -> bool:
    """Wait until nobody listens at a node's URI; return False after `limit_s`.

    `pause` waits for some seconds, and returns True to end the wait.
    """
    parts = urllib.parse.urlsplit(uri)
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        try:
            socket.create_connection((parts.hostname, parts.port or 80), _PROBE_S).close()
        except OSError:
            return True
        if pause(_POLL_S):
            return False
    return False
