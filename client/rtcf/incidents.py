"""The calls of a client about incidents: files with the last cycles before faults."""

from collections.abc import Iterable
from typing import IO

import grpc
from rtcf_shared.spec import several

from rtcf import failures
from rtcf.connection import CHANGE_TIMEOUT_S
from rtcf.streams.watching import Watching
from rtcf.v1 import incidents_pb2


class Incidents(Watching):
    """What of a Client looks at, keeps and removes them."""

    def list_incidents(self, runner: str = "") -> list[incidents_pb2.Incident]:
        """Return the files with the last cycles before faults, in the order in which they were
        kept; of all runners without one."""
        request = incidents_pb2.ListIncidentsRequest(runner=runner)
        return self._pages(self._stub.ListIncidents, request, "incidents")

    def take_incident(self, runner: str = "", reason: str = "") -> incidents_pb2.Incident:
        """Keep the last cycles now."""
        request = incidents_pb2.TakeIncidentRequest(runner=runner, reason=reason)
        return self._ask(self._stub.TakeIncident, request, CHANGE_TIMEOUT_S).incident  # type: ignore[no-any-return]

    def get_incident(self, to: IO[bytes], name: str = "") -> incidents_pb2.Incident:
        """Write the file of an incident, or of the newest, to an open file."""
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
        """Remove files of incidents, all of them or none; return what is gone."""
        request = incidents_pb2.DeleteIncidentsRequest(names=several("names", names))
        return list(self._ask(self._stub.DeleteIncidents, request).incidents)
