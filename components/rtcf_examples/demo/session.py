"""One run of the demo: starts the processes, prints the progress, collects the results."""

import signal
import sys
import time
from pathlib import Path

import figure
import rtcf
from processes import Child, Failure, Processes
from rtcf.v1 import runner_pb2
from summary import Outcome, show

FREQUENCY_HZ = 2000.0
# Messages queued for a slow node: 10 s of them, so that a busy machine drops none.
QUEUE = 20_000
_HERE = Path(__file__).resolve().parent
_CATCH_UP_S = 30.0


def run(build: Path, seconds: float) -> int:
    """Run the figure; return the exit status.  All processes end, even after an exception."""
    processes = Processes(build)
    try:
        outcome = _run(processes, seconds)
    except BaseException:
        for error in _end(processes):
            print(f"\ndemo: {error}", file=sys.stderr)
        raise
    return show(outcome, _end(processes))


def _end(processes: Processes) -> list[str]:
    # A second Ctrl-C must not interrupt the clean-up after the first one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    return processes.end()


def _run(processes: Processes, seconds: float) -> Outcome:
    print(
        "Fig. 1 of Fennel, Geyer, Hanebeck: RTCF, Software Impacts 9 (2021)\n"
        "Five components in one real-time loop, two ROS nodes around it.\n"
        "The ROS master and the daemon are private to this demo.\n",
        flush=True,
    )
    _say("ROS master", f"at {processes.master_uri}", processes.start_master())
    _say("rtcfd", f"serves {processes.socket}", processes.start_rtcfd())
    with rtcf.Client(processes.socket) as client:
        _set_up(client, processes)
        g1 = processes.start_node("G1", _HERE / "g1")
        g2 = processes.start_node("G2", _HERE / "g2")
        nodes = (g1, g2)
        processes.wait_until(
            lambda: all(node.newest.get("connected") for node in nodes), "G1 and G2 to connect"
        )
        _say("G1", "subscribes to /R1_H1R2", g1)
        _say("G2", "subscribes to /R3_G2H1, publishes /G2_R2", g2)
        print(f"\nRunning at {FREQUENCY_HZ:g} Hz for {seconds:g} s:")
        client.start()
        try:
            _watch(client, processes, seconds, nodes)
        finally:
            # Statistics and values of the loop stay readable after the stop.
            client.stop()
        status = client.get_status("rt_runner").runners[0]
        _wait_for_messages(processes, status.iteration, nodes)
        return Outcome(
            seconds=seconds,
            frequency_hz=FREQUENCY_HZ,
            order=client.get_order(),
            status=status,
            statistics=client.get_statistics(),
            answer=next(p for p in client.get_component("R2").ports if p.name == "in4"),
            g1=g1.newest,
            g2=g2.newest,
        )


def _say(name: str, description: str, child: Child) -> None:
    print(f"  {name:<11} pid {child.pid:<7} {description}", flush=True)


def _set_up(client: rtcf.Client, processes: Processes) -> None:
    """Load the figure and print its connections as rtcfd reports them."""
    ros = runner_pb2.RosSettings(whitelist=figure.WHITELIST, queue=QUEUE)
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ, ros=ros))
    for name in figure.WIRES:
        client.load(figure.component(name))
    print("  components  H1 F1 R1 R2 R3, each a Mimo of rtcf_examples; their connections:")
    for connection in client.list_connections():
        if len(connection.readers) + connection.HasField("writer") < 2 and not (
            connection.published or connection.subscribed
        ):
            continue  # an unconnected port
        writer = connection.writer
        begin = f"{writer.component[1:]}.{writer.port}" if connection.HasField("writer") else "ROS"
        ends = [
            f"{r.component[1:]}.{r.port}{' (next cycle)' if r.broken else ''}"
            for r in connection.readers
        ] + ["ROS"] * connection.published
        print(f"                {connection.name:<10} {begin:<7} → {', '.join(ends)}")

    def registered() -> bool:
        found = client.get_status("rt_runner").runners[0].ros
        return found.connected and (found.publications, found.subscriptions) == (2, 1)

    processes.wait_until(registered, "the topics of the loop")


def _watch(
    client: rtcf.Client, processes: Processes, seconds: float, nodes: tuple[Child, Child]
) -> None:
    """Print the progress until the time is up."""
    terminal = sys.stdout.isatty()
    begin = time.monotonic()
    step_s = min(0.1 if terminal else 1.0, seconds)
    shown = 0
    while (passed := time.monotonic() - begin) < seconds:
        processes.check()
        if passed >= shown * step_s:
            shown += 1
            _progress(client, passed, seconds, nodes, terminal)
        time.sleep(min(0.05, max(seconds - passed, 0.0)))
    _progress(client, seconds, seconds, nodes, terminal)
    if terminal:
        print()


def _progress(
    client: rtcf.Client, passed: float, seconds: float, nodes: tuple[Child, Child], terminal: bool
) -> None:
    status = client.get_status("rt_runner").runners[0]
    if status.state != runner_pb2.RUNNER_STATE_RUNNING:
        raise Failure(f"the loop has ended: {status.status}")
    width = 20
    bar = ("█" * int(width * passed / seconds)).ljust(width, "·")
    received = "   ".join(
        f"{node.name} {node.newest.get('received', 0):>6} messages" for node in nodes
    )
    line = (
        f"  {bar} {passed:4.1f} s   cycle {status.iteration:>6}   {received}   "
        f"{status.overruns} overruns"
    )
    print(line, end="\r" if terminal else "\n", flush=True)


def _wait_for_messages(processes: Processes, count: int, nodes: tuple[Child, Child]) -> None:
    """Wait until the nodes have received all messages; the summary reports missing ones."""
    deadline = time.monotonic() + _CATCH_UP_S
    while time.monotonic() < deadline:
        processes.check()
        if all(node.newest["received"] >= count for node in nodes):
            return
        time.sleep(0.05)
