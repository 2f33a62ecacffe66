"""`rtcfctl metrics`: statistics of all runners for Prometheus, printed once or served at a port."""

import argparse
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared.enums import word

from rtcfctl.terminal.output import Output

if TYPE_CHECKING:
    from prometheus_client.core import Metric

LOOPBACK = "127.0.0.1"
# Bounds of buckets in seconds; Prometheus requires the same ones in each answer.
_BOUNDS = tuple(step * 10.0**power for power in range(-7, 0) for step in (1, 2, 5))
_QUANTILES = (("0.5", "p50_ns"), ("0.99", "p99_ns"), ("0.999", "p999_ns"), ("1", "max_ns"))

# Name, description and value.  Counters start with the loop, or with the last
# `rtcfctl stats --reset`.
_COUNTERS: tuple[tuple[str, str, Callable[[runner_pb2.RunnerStatistics], int]], ...] = (
    ("rtcf_cycles", "Cycles of the loop", lambda found: found.iterations),
    ("rtcf_overruns", "Cycles that ended after the start of the next period",
     lambda found: found.overruns),
    ("rtcf_missed_cycles", "Cycles left out because others took too long",
     lambda found: found.missed),
    ("rtcf_late_wake_ups", "Overruns because the machine woke the loop late",
     lambda found: found.late_wake_ups),
    ("rtcf_uncounted_cycles", "Cycles missing in the durations, overwritten before the count",
     lambda found: found.uncounted),
    ("rtcf_lost_values", "Published values that the ROS node took too late",
     lambda found: found.tap_dropped),
    ("rtcf_lost_log_records", "Log records dropped because a ring was full",
     lambda found: found.log_dropped),
    ("rtcf_major_page_faults", "Page faults of the real-time thread with disk access",
     lambda found: found.major_faults),
    ("rtcf_minor_page_faults", "Page faults of the real-time thread without disk access",
     lambda found: found.minor_faults),
    ("rtcf_involuntary_context_switches", "Times that the kernel preempted the real-time thread",
     lambda found: found.involuntary_switches),
)  # fmt: skip


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    metrics = verbs.add_parser(
        "metrics", parents=[common], help="print or serve statistics of all runners for Prometheus"
    )
    metrics.add_argument(
        "--listen", metavar="[ADDRESS:]PORT",
        help=f"serve them until Ctrl-C (default address: {LOOPBACK})",
    )  # fmt: skip
    metrics.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print or serve the metrics."""
    try:
        import prometheus_client
    except ImportError:
        # Like a usage error, which ends rtcf-metrics.service for good.
        raise ValueError(
            "prometheus_client not found: sudo apt install python3-prometheus-client"
        ) from None
    registry = prometheus_client.CollectorRegistry()
    registry.register(_Collector(lambda: rtcf.Client(args.socket)))  # type: ignore[arg-type]
    if args.listen is None:
        client.get_status()  # raises an error of rtcfd; collect() hides it
        print(prometheus_client.generate_latest(registry).decode(), end="")
        return
    address, port = _place(args.listen)
    try:
        prometheus_client.start_http_server(port, address, registry)
    except OSError as error:
        raise rtcf.RtcfError(f"{address}:{port}: {error.strerror or error}") from None
    shown = f"[{address}]" if ":" in address else address
    print(f"http://{shown}:{port}/metrics", flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        return


def _place(text: str) -> tuple[str, int]:
    address, _, port = text.rpartition(":")
    address = address.removeprefix("[").removesuffix("]")
    if not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"--listen {text}: use PORT or ADDRESS:PORT")
    return address or LOOPBACK, int(port)


class _Collector:
    """A collector for prometheus_client, called by its threads; each call uses a new client."""

    def __init__(self, connect: Callable[[], rtcf.Client]) -> None:
        self._connect = connect
        self._lock = threading.Lock()

    def collect(self) -> "Iterator[Metric]":
        """Yield the metrics; without rtcfd only rtcf_up, which is 0."""
        from prometheus_client.core import GaugeMetricFamily

        with self._lock:
            try:
                with self._connect() as client:
                    runners, statistics = _asked(client)
            except rtcf.RtcfError:
                yield GaugeMetricFamily("rtcf_up", "Whether rtcfd answers", 0)
                return
        yield GaugeMetricFamily("rtcf_up", "Whether rtcfd answers", 1)
        yield from _of_runners(runners)
        yield from _of_loops(statistics)
        yield from _of_components(statistics)


def _asked(
    client: rtcf.Client,
) -> tuple[list[runner_pb2.RunnerStatus], list[runner_pb2.RunnerStatistics]]:
    runners = list(client.get_status().runners)
    statistics = []
    for each in runners:
        try:
            statistics.append(client.get_statistics(each.runner, buckets=True))
        except rtcf.RefusedError:  # the runner is down or was removed
            continue
    return runners, statistics


def _of_runners(runners: list[runner_pb2.RunnerStatus]) -> "Iterator[Metric]":
    from prometheus_client.core import GaugeMetricFamily

    kinds = runner_pb2.RunnerState.DESCRIPTOR
    names = [word(kinds, number) for number in runner_pb2.RunnerState.values() if number]
    states = GaugeMetricFamily(
        "rtcf_runner_state", "1 for the present state of a runner", labels=("runner", "state")
    )
    rates = GaugeMetricFamily(
        "rtcf_frequency_hertz", "Configured cycles per second", labels=("runner",)
    )
    for runner in runners:
        now = word(kinds, runner.state)
        for name in names:
            states.add_metric((runner.runner, name), float(name == now))
        rates.add_metric((runner.runner,), runner.settings.frequency_hz)
    yield states
    yield rates


def _of_loops(statistics: list[runner_pb2.RunnerStatistics]) -> "Iterator[Metric]":
    from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily

    for name, what, figure in _COUNTERS:
        counter = CounterMetricFamily(name, what, labels=("runner",))
        for found in statistics:
            counter.add_metric((found.runner,), figure(found))
        yield counter
    durations = HistogramMetricFamily(
        "rtcf_cycle_duration_seconds", "Calculation duration of a cycle", labels=("runner",)
    )
    latencies = HistogramMetricFamily(
        "rtcf_wake_up_latency_seconds", "Wake-up latency after the deadline", labels=("runner",)
    )
    for found in statistics:
        for family, buckets, all_of_it in (
            (durations, found.duration_buckets, found.duration),
            (latencies, found.latency_buckets, found.latency),
        ):
            family.add_metric((found.runner,), _cumulated(buckets), _sum_s(all_of_it))
    yield durations
    yield latencies


def _cumulated(buckets: Sequence[runner_pb2.Bucket]) -> list[tuple[str, float]]:
    """Return the number of values up to each bound."""
    rows = []
    at = below = 0
    for bound in _BOUNDS:
        while at < len(buckets) and buckets[at].upper_ns <= bound * 1e9:
            below += buckets[at].count
            at += 1
        rows.append((f"{bound:g}", float(below)))
    rows.append(("+Inf", float(sum(each.count for each in buckets))))
    return rows


def _sum_s(found: runner_pb2.Distribution) -> float:
    return found.mean_ns * found.count / 1e9


def _of_components(statistics: list[runner_pb2.RunnerStatistics]) -> "Iterator[Metric]":
    from prometheus_client.core import CounterMetricFamily, SummaryMetricFamily

    labels = ("runner", "component")
    durations = SummaryMetricFamily(
        "rtcf_component_update_seconds", "Duration of update() of a component", labels=labels
    )
    overruns = CounterMetricFamily(
        "rtcf_component_overruns", "Overruns while the component was running", labels=labels
    )
    faults = CounterMetricFamily(
        "rtcf_component_faults", "Faults that did not stop the loop", labels=labels
    )
    for found in statistics:
        for each in found.components:
            named = (found.runner, each.component)
            distribution = each.duration
            for quantile, field in _QUANTILES:
                durations.add_sample(
                    durations.name,
                    {**dict(zip(labels, named, strict=True)), "quantile": quantile},
                    getattr(distribution, field) / 1e9,
                )
            durations.add_metric(named, distribution.count, _sum_s(distribution))
            overruns.add_metric(named, each.overruns)
            faults.add_metric(named, each.faults)
    yield durations
    yield overruns
    yield faults
