"""A ROS node for those who look: rosnode list, info, ping and kill know it, and a second node of
its name displaces it.  rospy would be one too, but waits for a master where we are to end.

It has no topics.  Its services are those that every node has, for its loggers.  When the master is
started anew, the node registers again.
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
_LOOK_S = 1.0  # between two looks at the master
_PROBE_S = 1.0


class _Handler(SimpleXMLRPCRequestHandler):
    rpc_paths = ()  # any

    def do_POST(self) -> None:
        """Answer a call, if it is no longer than one of a master's."""
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
        """Say nothing of callers that go away."""


class RosNode:
    """The node; owned by the process' main thread, served by threads of its own."""

    def __init__(
        self,
        master: Master,
        name: str,
        hostname: str,
        ended: Callable[[str], None],
        level_set: Callable[[str], None],
    ) -> None:
        """Serve; register() makes it known.

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
        """Make the node known; return where one of its name was before."""
        before = self._master.node_uri(self._name)
        self._register()
        return "" if before == self._uri else before

    def stay_registered(self, back: Callable[[], None]) -> None:
        """Register again at each master that does not know the node; then call `back`, by a thread
        of the node's.  Another node of its name is left alone."""
        threading.Thread(target=self._stay_registered, args=(back,), daemon=True).start()

    def _register(self) -> None:
        for service in self._services.names:
            self._master.register_service(service, self._service_uri, self._uri)

    def _stay_registered(self, back: Callable[[], None]) -> None:
        while not self._ending.wait(_LOOK_S):
            try:
                if self._master.node_uri(self._name) or self._ending.is_set():
                    continue
                self._register()
            except MasterSilent:
                continue
            back()

    def end(self, master: Master) -> None:
        """Take all back, by a master object whose calls are short."""
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
            self._ended(why or "a ROS node has asked it to end")
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
    """Return when nobody listens at a node's URI any more; tell whether that is so in time.

    `pause` waits for some seconds, and returns true if waiting is to end.
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
