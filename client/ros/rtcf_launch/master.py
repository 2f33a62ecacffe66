"""A ROS master: its parameters and registrations, with a timeout for each call."""

import xmlrpc.client
from http.client import HTTPException
from typing import Any

TIMEOUT_S = 2.0


class MasterSilent(Exception):
    """No master answers."""


class _Transport(xmlrpc.client.Transport):
    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


class Master:
    """One master.  Each call raises MasterSilent after `timeout_s` without an answer."""

    def __init__(self, uri: str, caller: str, timeout_s: float = TIMEOUT_S) -> None:
        self.uri = uri
        self._caller = caller
        self._timeout_s = timeout_s

    def parameter(self, name: str, default: Any = None) -> Any:
        """Return a parameter; a namespace is a dict."""
        code, _, value = self._call("getParam", name)
        return value if code == 1 else default

    def has(self, name: str) -> bool:
        """Return whether a parameter or namespace exists."""
        return bool(self._call("hasParam", name)[2])

    def set(self, name: str, value: Any) -> None:
        """Set a parameter."""
        self._call("setParam", name, value)

    def delete(self, name: str) -> None:
        """Delete a parameter if it exists."""
        self._call("deleteParam", name)

    def names(self) -> list[str]:
        """Return the names of all parameters."""
        code, _, names = self._call("getParamNames")
        return [str(name) for name in names] if code == 1 else []

    def node_uri(self, name: str) -> str:
        """Return the URI of a registered node; empty = there is no such node."""
        code, _, uri = self._call("lookupNode", name)
        return str(uri) if code == 1 else ""

    def service_uri(self, name: str) -> str:
        """Return the URI of a registered service; empty = there is no such service."""
        code, _, uri = self._call("lookupService", name)
        return str(uri) if code == 1 else ""

    def register_service(self, service: str, service_uri: str, node_uri: str) -> None:
        """Register a service.  The master shuts down another node with the caller's name."""
        self._call("registerService", service, service_uri, node_uri)

    def unregister_service(self, service: str, service_uri: str) -> None:
        """Withdraw the registration of a service."""
        self._call("unregisterService", service, service_uri)

    def _call(self, method: str, *arguments: Any) -> Any:
        # A connection for each call, because the master may be restarted between two calls.
        try:
            proxy = xmlrpc.client.ServerProxy(self.uri, transport=_Transport(self._timeout_s))
            with proxy:
                answer = getattr(proxy, method)(self._caller, *arguments)
            if not (isinstance(answer, list) and len(answer) == 3):
                raise ValueError
            return answer
        except (OSError, HTTPException, xmlrpc.client.Error, ValueError):
            raise MasterSilent(
                f"no ROS master answers at {self.uri}: start roscore, or set ROS_MASTER_URI"
            ) from None
