"""An executor's side of its protocol, for tests of rtcfd without real-time parts.

Uses the real message framing over a real unix socket and keeps a list of components.
A "library" here is a JSON file: {"types": {"Name": "behaviour"}, "problem":
"...", "crash": "SIGSEGV"}; behaviours of a type at its load: "fine",
"refused", "crashes", "slow" (until the file named by its parameter `until`
exists), "logs", "chatters".

PEER_PROTOCOL is its protocol version, PEER_LATER_PROTOCOL the version that it
reports to the next rtcfd.

A file named <kind of request> in the folder PEER_HELD delays the answers to requests of
that kind until it is removed; `serve` delays the executor's start, `gone` its end. If
`brief` exists, a loop ends by a fault right after the answer to its start.

PEER_PORT is the name of each component's input.

Setting a parameter `die` ends the process as if the component's update had failed: "exit" and
"SIGKILL" leave no crash in the flight recorder; other signals and "stall" leave one.

The loop counts its cycles by the wall clock.
"""

import argparse
import asyncio
import json
import os
import signal
import sys
import time
from pathlib import Path

from flight_writer import FlightWriter
from google.protobuf import json_format
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2, ports_pb2, runner_pb2
from rtcfd import VERSION
from rtcfd.executor.link import (
    ACCESS_PROTOCOL,
    LIMITS_PROTOCOL,
    PORTS_PROTOCOL,
    PROTOCOL,
    pack_message,
    read_message,
)

POLL_S = 0.005
CHATTER = 100  # records per burst
GRAPH_SLOT, UPDATE_SLOT = 1, 2


def describe(library: Path, package: str) -> int:
    contents = json.loads(library.read_text())
    if "crash" in contents:
        os.kill(os.getpid(), signal.Signals[contents["crash"]])
    description = wire.LibraryDescription(
        problem=contents.get("problem", ""),
        types=[
            graph_pb2.ComponentType(
                package=package, type=name, ports=declared().ports, parameters=declared().parameters
            )
            for name in contents.get("types", {})
        ],
    )
    sys.stdout.buffer.write(description.SerializeToString())
    return 1 if description.problem else 0


def declared() -> graph_pb2.ComponentInfo:
    """Return the description that every component here has."""
    info = graph_pb2.ComponentInfo()
    json_format.Parse(
        """{"state": "COMPONENT_STATE_CONFIGURED", "ports": [
        {"name": "in1", "direction": "DIRECTION_INPUT", "mapped_name": "/a[1]",
         "type": "std_msgs/Float64", "value": "1.5", "age_ns": "2500000"},
        {"name": "out1", "direction": "DIRECTION_OUTPUT", "mapped_name": "/b",
         "type": "double"}],
        "parameters": [{"name": "kp", "type": "double", "value": {"double_value": 1.0},
         "default_value": {"double_value": 1.0}, "minimum": 0.0, "doc": "gain"}]}""",
        info,
    )
    info.ports[0].name = os.environ.get("PEER_PORT", "in1")
    return info


def is_held(kind: str) -> bool:
    folder = os.environ.get("PEER_HELD")
    return folder is not None and (Path(folder) / kind).exists()


async def held(kind: str) -> None:
    if is_held(kind):
        (Path(os.environ["PEER_HELD"]) / f"{kind} waits").touch()
    while is_held(kind):
        await asyncio.sleep(POLL_S)


class Refused(Exception):
    """Carries an Error code."""


class Peer:
    # Of a component: as many cycles as in a day at 10 kHz, the longest takes a tenth of a second.
    SLOW = runner_pb2.Distribution(
        count=864_000_000, min_ns=123_456.0, mean_ns=1_234_567.0, p50_ns=1_234_567.0,
        p99_ns=9_999_999.0, p999_ns=12_345_678.0, max_ns=123_456_789.0,
    )  # fmt: skip

    def __init__(self, runner: str) -> None:
        self.runner = runner
        self.settings = runner_pb2.RunnerSettings()
        self.running = False
        self.started = 0.0
        self.connections = 0
        self.hellos = 0
        self.protocol = int(os.environ.get("PEER_PROTOCOL", PROTOCOL))
        self.generation = 0
        self.components: dict[str, graph_pb2.ComponentSpec] = {}
        self.live: dict[str, dict[str, graph_pb2.ParameterValue]] = {}
        self.recorder = FlightWriter()
        self.end = asyncio.Event()
        self.tasks: set[asyncio.Task[None]] = set()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writer = writer
        self.connections += 1
        while (message := await read_message(reader)) is not None:
            task = asyncio.create_task(self.answer(wire.Request.FromString(message)))
            self.tasks.add(task)
            task.add_done_callback(self.tasks.discard)
        self.connections -= 1
        await asyncio.sleep(self.settings.orphan_timeout_s)
        if not self.connections:
            self.end.set()

    def send(self, response: wire.Response) -> None:
        self.writer.write(pack_message(response.SerializeToString()))

    async def answer(self, request: wire.Request) -> None:
        kind = request.WhichOneof("kind")
        assert kind is not None
        await held(kind)
        try:
            response = await getattr(self, kind)(getattr(request, kind), request.id)
        except Refused as refused:
            code, text = refused.args
            response = wire.Response(error=wire.Error(code=code, message=text))
        response.id = request.id
        answer = pack_message(response.SerializeToString())
        if kind == "start" and is_held("brief"):
            self.running = False
            event = wire.Event(kind=wire.Event.KIND_LOOP_ENDED, message="ended by a fault")
            answer += pack_message(wire.Response(event=event).SerializeToString())
        self.writer.write(answer)
        if kind == "exit":
            await self.writer.drain()
            self.end.set()

    async def hello(self, _: wire.Hello, __: int) -> wire.Response:
        self.hellos += 1
        if self.hellos > 1 and (later := os.environ.get("PEER_LATER_PROTOCOL")):
            self.protocol = int(later)
        return wire.Response(
            hello=wire.HelloResult(
                protocol=self.protocol,
                version=os.environ.get("PEER_VERSION", VERSION),
                runner=self.runner,
                pid=os.getpid(),
                flight_recorder_fd=self.recorder.descriptor,
            )
        )

    async def limits(self, _: wire.Limits, __: int) -> wire.Response:
        if self.protocol < LIMITS_PROTOCOL:
            os._exit(9)  # an executor that does not know them must not be asked
        return wire.Response(done=wire.Done())

    async def access(self, _: wire.AccessRules, __: int) -> wire.Response:
        if self.protocol < ACCESS_PROTOCOL:
            os._exit(9)
        return wire.Response(done=wire.Done())

    async def watch_ports(self, _: ports_pb2.WatchPortsRequest, __: int) -> wire.Response:
        if self.protocol < PORTS_PROTOCOL:
            os._exit(9)
        raise Refused(wire.Error.CODE_NOT_FOUND, "this peer has no ports")

    async def configure(self, change: runner_pb2.RunnerSettings, _: int) -> wire.Response:
        if change.ros.whitelist == "(":
            raise Refused(wire.Error.CODE_INVALID_ARGUMENT, 'whitelist "(": unmatched (')
        self.settings.MergeFrom(change)
        return await self.get_status(wire.GetStatus(), 0)

    async def get_status(self, _: wire.GetStatus, __: int) -> wire.Response:
        state = runner_pb2.RUNNER_STATE_RUNNING if self.running else runner_pb2.RUNNER_STATE_STOPPED
        return wire.Response(
            status=runner_pb2.RunnerStatus(
                runner=self.runner,
                state=state,
                settings=self.settings,
                iteration=self.iteration(),
                components=len(self.components),
                degraded=["no permission for SCHED_FIFO"],
            )
        )

    def iteration(self) -> int:
        """Cycles since the start, at 1 kHz."""
        return int(1000 * (time.monotonic() - self.started)) if self.running else 0

    async def start(self, _: wire.Start, __: int) -> wire.Response:
        if not self.running:
            self.started = time.monotonic()
        self.running = True
        return self.changed()

    async def stop(self, _: wire.Stop, __: int) -> wire.Response:
        self.running = False
        return self.changed()

    async def load(self, load: wire.Load, id_: int) -> wire.Response:
        spec = load.component
        name = f"{spec.ns.rstrip('/')}/{spec.name or spec.type}"
        if name in self.components:
            raise Refused(wire.Error.CODE_ALREADY_EXISTS, f"component {name} is there already")
        await self.behave(load.library, spec, id_)
        self.components[name] = spec
        return self.changed(name)

    async def behave(self, library: str, spec: graph_pb2.ComponentSpec, id_: int) -> None:
        behaviour = json.loads(Path(library).read_text())["types"][spec.type]
        if behaviour == "refused":
            raise Refused(wire.Error.CODE_FAILED_PRECONDITION, f"{spec.type}.configure failed")
        if behaviour == "crashes":
            name = f"{spec.ns.rstrip('/')}/{spec.name or spec.type}"
            self.recorder.hook(self.recorder.name(GRAPH_SLOT, name), 2)
            self.recorder.crash(signal.SIGSEGV, 2)
            os.kill(os.getpid(), signal.SIGSEGV)
        if behaviour == "slow":
            self.send(wire.Response(id=id_, progress=f"configuring {spec.type}"))
            until = Path(spec.parameters[0].value.string_value)
            while not until.exists():
                await asyncio.sleep(POLL_S)
        if behaviour == "chatters":
            for number in range(CHATTER):
                record = wire.LogRecord(level=wire.LogRecord.LEVEL_INFO, message=f"line {number}")
                self.send(wire.Response(log=record))
        if behaviour == "logs":
            record = wire.LogRecord(
                level=wire.LogRecord.LEVEL_WARN,
                time_ns=1_700_000_000_500_000_000,
                iteration=7,
                component="/Logs",
                message="from the loop",
                file="/src/logs.cpp",
                line=12,
                function="update",
            )
            self.send(wire.Response(log=record))

    async def apply(self, request: wire.Apply, id_: int) -> wire.Response:
        wanted = {}
        result = self.changed()
        kinds = control_pb2.Difference
        for load in request.components:
            spec = load.component
            name = f"{spec.ns.rstrip('/')}/{spec.name or spec.type}"
            known = self.components.get(name)
            if known is None:
                kind = kinds.KIND_LOAD
                await self.behave(load.library, spec, id_)
            elif known != spec:
                kind = kinds.KIND_REPLACE
            else:
                kind = kinds.KIND_UNSPECIFIED
            if kind:
                result.change.differences.append(kinds(kind=kind, component=name))
            wanted[name] = spec
        for name in self.components:
            if name not in wanted:
                result.change.differences.append(kinds(kind=kinds.KIND_UNLOAD, component=name))
        if not request.dry_run:
            self.components = wanted
            self.live = {}
            result.change.order[:] = sorted(wanted)
        return result

    async def unload(self, request: control_pb2.UnloadRequest, _: int) -> wire.Response:
        if not request.components:
            raise Refused(wire.Error.CODE_INVALID_ARGUMENT, "no component to unload is named")
        for name in request.components:
            if name not in self.components:
                raise Refused(wire.Error.CODE_NOT_FOUND, f"no component {name}")
        for name in request.components:
            del self.components[name]
            self.live.pop(name, None)
        return self.changed()

    async def replace(self, request: wire.Replace, id_: int) -> wire.Response:
        if request.component not in self.components:
            raise Refused(wire.Error.CODE_NOT_FOUND, f"no component {request.component}")
        spec = request.replacement
        await self.behave(request.library, spec, id_)
        del self.components[request.component]
        self.live.pop(request.component, None)
        name = f"{spec.ns.rstrip('/')}/{spec.name}"
        self.components[name] = spec
        return self.changed(name)

    async def set_breaks(self, request: control_pb2.SetBreaksRequest, _: int) -> wire.Response:
        for each in request.ports:
            breaks = self.components[f"/{each.component.lstrip('/')}"].breaks
            others = [port for port in breaks if port != each.port]
            breaks[:] = [*others, each.port] if request.broken else others
        return self.changed()

    async def set_parameters(
        self, request: control_pb2.SetParametersRequest, _: int
    ) -> wire.Response:
        for setting in request.parameters:
            if setting.name == "die":
                self.die(request.component, setting.value.string_value)
        name = "/" + request.component.lstrip("/")
        self.live[name] = {each.name: each.value for each in request.parameters}
        return self.changed()

    def die(self, name: str, how: str) -> None:
        self.recorder.loop(self.iteration(), self.running)
        self.recorder.update(self.recorder.name(UPDATE_SLOT, name))
        if how == "exit":
            os._exit(3)
        if how == "stall":
            self.recorder.crash(signal.SIGABRT, 1, stalled=True)
            os.kill(os.getpid(), signal.SIGABRT)
        if how != "SIGKILL":
            self.recorder.crash(signal.Signals[how], 1, address=0x10)
        os.kill(os.getpid(), signal.Signals[how])

    async def list_components(self, _: wire.ListComponents, __: int) -> wire.Response:
        infos = [self.info(name, at) for at, name in enumerate(sorted(self.components))]
        infos.reverse()  # rtcfd must sort by position
        return wire.Response(components=wire.ListComponentsResult(components=infos))

    async def get_component(
        self, request: control_pb2.GetComponentRequest, _: int
    ) -> wire.Response:
        if request.component not in self.components:
            raise Refused(wire.Error.CODE_NOT_FOUND, f"no component {request.component}")
        return wire.Response(component=self.info(request.component, 0))

    def info(self, name: str, position: int) -> graph_pb2.ComponentInfo:
        info = declared()
        info.full_name = name
        info.position = position
        info.spec.CopyFrom(self.components[name])
        given = {each.name: each.value for each in info.spec.parameters}
        given |= self.live.get(name, {})
        if "kp" in given:
            info.parameters[0].value.CopyFrom(given["kp"])
        return info

    async def list_connections(self, _: wire.ListConnections, __: int) -> wire.Response:
        names = sorted(self.components, reverse=True)
        return wire.Response(
            connections=wire.ListConnectionsResult(
                connections=[
                    graph_pb2.Connection(
                        name=f"{name}_out", writer=graph_pb2.Endpoint(component=name, port="out1")
                    )
                    for name in names
                ]
            )
        )

    async def get_statistics(self, _: wire.GetStatistics, __: int) -> wire.Response:
        distribution = runner_pb2.Distribution(count=10, min_ns=1000.0, mean_ns=1500.0, max_ns=2e3)
        return wire.Response(
            statistics=runner_pb2.RunnerStatistics(
                iterations=10,
                duration=distribution,
                latency=distribution,
                overruns=1,
                components=[
                    runner_pb2.ComponentStatistics(component=name, duration=self.SLOW, overruns=10)
                    for name in self.components
                ],
            )
        )

    async def reset_statistics(self, _: wire.ResetStatistics, __: int) -> wire.Response:
        return wire.Response(done=wire.Done())

    async def exit(self, _: wire.Exit, __: int) -> wire.Response:
        return wire.Response(done=wire.Done())

    def changed(self, component: str = "") -> wire.Response:
        self.generation += 1
        return wire.Response(
            change=control_pb2.ChangeResult(
                generation=self.generation, component=component, order=sorted(self.components)
            )
        )


async def run(runner: str, socket: str) -> None:
    peer = Peer(runner)
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, peer.end.set)
    await held("serve")
    server = await asyncio.start_unix_server(peer.serve, socket)
    await peer.end.wait()
    await held("gone")
    server.close()


def main() -> int:
    parser = argparse.ArgumentParser()
    for option in (
        "--runner",
        "--socket",
        "--daemon",
        "--stop-socket",
        "--resume-mark",
        "--cpu-claims",
        "--package",
        "--trust",
    ):
        parser.add_argument(option)
    parser.add_argument("--describe", type=Path)
    args = parser.parse_args()
    if args.describe:
        return describe(args.describe, args.package)
    asyncio.run(run(args.runner, args.socket))
    return 0


if __name__ == "__main__":
    sys.exit(main())
