"""Calls about incidents: files with the last cycles before a fault."""

from collections.abc import Iterable
from typing import IO

import grpc
from rtcf_shared.spec import several

from rtcf import failures
from rtcf.connection import CHANGE_TIMEOUT_S
from rtcf.streams.watching import Watching
from rtcf.v1 import incidents_pb2


class Incidents(Watching):
    """The part of Client that lists, takes, reads and removes incidents."""

    def list_incidents(self, runner: str = "") -> list[incidents_pb2.Incident]:
        """Return the incidents of `runner` or of all runners, oldest first."""
        request = incidents_pb2.ListIncidentsRequest(runner=runner)
        return self._pages(self._stub.ListIncidents, request, "incidents")

    def take_incident(self, runner: str = "", reason: str = "") -> incidents_pb2.Incident:
        """Save the last cycles of a runner as an incident."""
        request = incidents_pb2.TakeIncidentRequest(runner=runner, reason=reason)
        return self._ask(self._stub.TakeIncident, request, CHANGE_TIMEOUT_S).incident  # type: ignore[no-any-return]

    def get_incident(self, to: IO[bytes], name: str = "") -> incidents_pb2.Incident:
        """Write the content of an incident, by default the newest, to the open file `to`."""
        request = incidents_pb2.ReadIncidentRequest(name=name)
        incident = incidents_pb2.Incident()
        try:
            for response in self._stub.ReadIncident(request, timeout=CHANGE_TIMEOUT_S):
                if response.HasField("incident"):
                    incident = response.incident
                to.write(response.data)
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self.socket) from None
        return incident

    def remove_incidents(self, names: Iterable[str]) -> list[incidents_pb2.Incident]:
        """Remove incidents, all of them or none; return the removed ones."""
        request = incidents_pb2.DeleteIncidentsRequest(names=several("names", names))
        return list(self._ask(self._stub.DeleteIncidents, request).incidents)
