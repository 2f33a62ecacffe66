"""`rtcfctl metrics`: all runners' figures as Prometheus takes them, once or at a port."""

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
# Of seconds; the same in each answer, as Prometheus asks.
_BOUNDS = tuple(step * 10.0**power for power in range(-7, 0) for step in (1, 2, 5))
_QUANTILES = (("0.5", "p50_ns"), ("0.99", "p99_ns"), ("0.999", "p999_ns"), ("1", "max_ns"))

# Name, what it is, and where it is found: each is counted from the start of the loop, or from
# `rtcfctl stats --reset`.
_COUNTERS: tuple[tuple[str, str, Callable[[runner_pb2.RunnerStatistics], int]], ...] = (
    ("rtcf_cycles", "Cycles of the loop", lambda found: found.iterations),
    ("rtcf_overruns", "Cycles that ended after the next should have begun",
     lambda found: found.overruns),
    ("rtcf_missed_cycles", "Cycles that were left out, as others took too long",
     lambda found: found.missed),
    ("rtcf_late_wake_ups", "Overruns that the machine caused by waking the loop late",
     lambda found: found.late_wake_ups),
    ("rtcf_lost_values", "Mapped values lost in full rings", lambda found: found.tap_dropped),
    ("rtcf_lost_log_records", "Log records lost in full rings", lambda found: found.log_dropped),
    ("rtcf_major_page_faults", "Page faults of the real-time thread with disk access",
     lambda found: found.major_faults),
    ("rtcf_minor_page_faults", "Page faults of the real-time thread without disk access",
     lambda found: found.minor_faults),
    ("rtcf_involuntary_context_switches", "Times that the real-time thread was put aside",
     lambda found: found.involuntary_switches),
)  # fmt: skip


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    metrics = verbs.add_parser(
        "metrics", parents=[common], help="figures of all runners for Prometheus"
    )
    metrics.add_argument(
        "--listen", metavar="[ADDRESS:]PORT",
        help=f"serve them until Ctrl-C; at {LOOPBACK} unless an address is given",
    )  # fmt: skip
    metrics.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print them, or serve them."""
    try:
        import prometheus_client
    except ImportError:
        raise rtcf.RtcfError(
            "nothing here knows Prometheus's format: sudo apt install python3-prometheus-client"
        ) from None
    figures = prometheus_client.CollectorRegistry()
    figures.register(_Figures(lambda: rtcf.Client(args.socket)))  # type: ignore[arg-type]
    if args.listen is None:
        client.get_status()  # a refusal is told in its own words
        print(prometheus_client.generate_latest(figures).decode(), end="")
        return
    address, port = _place(args.listen)
    try:
        prometheus_client.start_http_server(port, address, figures)
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
        raise ValueError(f"--listen {text}: a port, or ADDRESS:PORT")
    return address or LOOPBACK, int(port)


class _Figures:
    """What Prometheus collects; each time by a client of its own, one after the other."""

    def __init__(self, connect: Callable[[], rtcf.Client]) -> None:
        self._connect = connect
        self._lock = threading.Lock()

    def collect(self) -> "Iterator[Metric]":
        """Ask for them, and give them; without rtcfd that it is not there."""
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
        except rtcf.RefusedError:  # it is down, or was removed meanwhile
            continue
    return runners, statistics


def _of_runners(runners: list[runner_pb2.RunnerStatus]) -> "Iterator[Metric]":
    from prometheus_client.core import GaugeMetricFamily

    kinds = runner_pb2.RunnerState.DESCRIPTOR
    names = [word(kinds, number) for number in runner_pb2.RunnerState.values() if number]
    states = GaugeMetricFamily(
        "rtcf_runner_state", "1 of the state that the runner is in", labels=("runner", "state")
    )
    rates = GaugeMetricFamily(
        "rtcf_frequency_hertz", "Cycles a second that the runner is set to", labels=("runner",)
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
        "rtcf_cycle_duration_seconds", "Calculation of a cycle", labels=("runner",)
    )
    latencies = HistogramMetricFamily(
        "rtcf_wake_up_latency_seconds", "Wake-up after the deadline", labels=("runner",)
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
    """Return how many values are not above each bound."""
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
        "rtcf_component_update_seconds", "update() of a component", labels=labels
    )
    overruns = CounterMetricFamily(
        "rtcf_component_overruns", "Overruns while the component was running", labels=labels
    )
    faults = CounterMetricFamily(
        "rtcf_component_faults", "Faults that the loop went on after", labels=labels
    )
    for found in statistics:
        for each in found.components:
            named = (found.runner, each.component)
            figures = each.duration
            for quantile, field in _QUANTILES:
                durations.add_sample(
                    durations.name,
                    {**dict(zip(labels, named, strict=True)), "quantile": quantile},
                    getattr(figures, field) / 1e9,
                )
            durations.add_metric(named, figures.count, _sum_s(figures))
            overruns.add_metric(named, each.overruns)
            faults.add_metric(named, each.faults)
    yield durations
    yield overruns
    yield faults
