"""The calls of a client that follow something: figures, events, logs, values of every cycle."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import grpc
from rtcf_shared.spec import several

from rtcf import failures
from rtcf.connection import Connection
from rtcf.streams.events import EventStream
from rtcf.streams.logs import LogStream
from rtcf.streams.numbered import Place
from rtcf.v1 import control_pb2, ports_pb2, runner_pb2

if TYPE_CHECKING:
    from rtcf.streams.ports import PortStream


class Watching(Connection):
    """What of a Client begins streams."""

    def watch_statistics(
        self, runner: str = "", interval_s: float = 1.0
    ) -> Iterator[runner_pb2.RunnerStatistics]:
        """Yield the figures now and after each interval (at least 0.1 s), without end but by a
        refusal, as when the runner is removed."""
        request = control_pb2.WatchStatisticsRequest(
            runner=runner, interval_ms=round(interval_s * 1000)
        )
        try:
            for response in self._stub.WatchStatistics(request):
                yield response.statistics
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self.socket) from None

    def watch_events(
        self,
        runners: Iterable[str] = (),
        after: Place | None = None,
        *,
        until_now: bool = False,
    ) -> EventStream:
        """Watch what happens to some runners, or all, and to rtcfd itself.

        Begins behind `after`, the `place` of a stream of before; Place() is where what rtcfd keeps
        begins, None is now.  With `until_now` it ends with what has happened so far; without, it
        ends with a refusal when none of the runners is there.
        """
        return EventStream(
            self._stub.WatchEvents, self.socket, several("runners", runners), after, until_now
        )

    def watch_logs(
        self,
        runner: str = "",
        components: Iterable[str] = (),
        level: str = "debug",
        after: Place | None = None,
        *,
        until_now: bool = False,
    ) -> LogStream:
        """Watch what a runner's components and its executor log, or only some components; `level`
        is the lowest one: "debug", "info", "warn", "error" or "fatal".

        `after` and `until_now` are as in watch_events; it ends with a refusal when the runner is
        removed.  Raises ValueError on a level that there is not.
        """
        return LogStream(
            self._stub.WatchLogs,
            self.socket,
            runner,
            several("components", components),
            level,
            after,
            until_now,
        )

    def watch_ports(
        self,
        selection: Iterable[str] = (),
        runner: str = "",
        every: int = 1,
        *,
        min_max: bool = False,
        component_times: bool = False,
        allow_missing: bool = False,
    ) -> "PortStream":
        """Watch values of outputs and declared state, of each `every`-th cycle, or (`min_max`) the
        minima and maxima of each `every` cycles, which hide no value: see PortBatch.minima().

        `selection` names them with the wildcards of a shell, e.g. "/arm/*.effort"; all without.
        With `component_times` each cycle also has the time at which the update() of each component
        ended: see PortBatch.turns_ns; not with `min_max`.
        A pattern that matches nothing is an error; with `allow_missing` it applies to components
        that are loaded later.
        Nothing is missed from here on; what the caller does not take in time is counted.
        """
        # Few commands need it, and each import is time.
        from rtcf.streams.ports import PortStream

        return PortStream(
            self._stub.WatchPorts,
            self.socket,
            ports_pb2.WatchPortsRequest(
                runner=runner,
                selection=several("selection", selection),
                every=every,
                min_max=min_max,
                component_times=component_times,
                allow_missing=allow_missing,
            ),
        )
