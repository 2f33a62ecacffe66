"""Calls that open streams: statistics, events, log records, values of every cycle."""

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
    """The part of Client that opens streams."""

    def watch_statistics(
        self, runner: str = "", interval_s: float = 1.0
    ) -> Iterator[runner_pb2.RunnerStatistics]:
        """Yield the statistics of a runner now and after each interval (at least 0.1 s).

        The stream only ends with an error, for example after removal of the runner.
        """
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
        """Open a stream of events of some runners (default: all) and of rtcfd.

        after      the `place` of an earlier stream; Place() starts with the oldest event that
                   rtcfd keeps, None with new events
        until_now  end after the events so far; otherwise the stream ends with an error when none
                   of the runners exists
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
        """Open a stream of log records of a runner's components and executor.

        components  if not empty, only records of these
        level       the lowest level: "debug", "info", "warn", "error" or "fatal"

        `after` and `until_now` are as in watch_events.  The stream ends with an error after removal
        of the runner.  Raises ValueError for an unknown level.
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
        """Open a stream of values of outputs and declared state, of each `every`-th cycle.

        selection        names with the wildcards of a shell, e.g. "/arm/*.effort" (default: all)
        min_max          minima and maxima of each `every` cycles instead, see PortBatch.minima()
        component_times  also the time at which each component's update() ended, see
                         PortBatch.turns_ns; not with `min_max`
        allow_missing    permit patterns without a match, for components to be loaded later;
                         otherwise such patterns are errors

        The stream has all cycles after the return of this call.  Cycles dropped because the caller
        is slow are counted.
        """
        # Imported here to keep other commands fast.
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
