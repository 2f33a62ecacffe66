"""Users who interrupt commands or do not wait for them."""

import random
import socket
from typing import Any

from machine import Machine, wait_for
from rtcf_service import Service

_DESK = "/var/tmp/desk"  # folder of the files they write
_LOOKING = (
    "status",
    "get M.out1",
    "echo /M.out1",
    "hz /M.out1",
    "top",
    "logs -f",
    "events -f",
    "plot /M.out1",
    "wait 'M.out1 > 1e30' --timeout 20",
    "write /M.in1 2.5",
    "record --force -o recording.mcap",
    "convert --force whole.mcap table.csv",
    "trace --force -o trace.json --cycles 100000",
    "graph -o graph.dot",
    "metrics --listen {port}",
    "incident take",
    "snapshot snapshot",
    "check rtcf_examples Mimo",
    "run own.yaml",
    "apply own.yaml",
)
# Verbs whose purpose is to end a loop or an executor.
_ENDING = ("runner add other", "runner remove other", "runner restart rt_runner")
_SEED = 7


def processes(machine: Machine) -> set[str]:
    return set(machine.shell("pgrep '^(rtcfd|rtcf-executor|rtcfctl)'; true").stdout.split())


def descriptors(service: Service) -> int:
    return len(service.machine.shell(f"ls /proc/{service.pid}/fd").stdout.split())


def runs_on(service: Service, before: dict[str, Any]) -> None:
    now = service.status()
    assert (now["pid"], now["state"]) == (before["pid"], "running")
    wait_for(lambda: service.iteration() > int(now["iteration"]), "cycles")


def test_an_interrupted_verb_ends_and_leaves_nothing(service: Service) -> None:
    machine = service.machine
    machine.shell(f"rm -rf {_DESK}; mkdir {_DESK}")
    loop = service.load_and_start()
    machine.shell(
        f"cd {_DESK} && rtcfctl save own.yaml && rtcfctl record -o whole.mcap --duration 1"
    )
    wait_for(lambda: len(processes(machine)) == 2, "only rtcfd and its executor to remain")
    before, living = descriptors(service), processes(machine)
    with socket.socket() as free:  # the machine shares this network
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    draw = random.Random(_SEED)

    def interrupt(verb: str) -> None:
        for after_s in (draw.uniform(0.05, 0.5), draw.uniform(0.5, 1.5)):
            line = f"cd {_DESK} && timeout -s INT -k 30 {after_s:.3f} rtcfctl {verb}"
            done = machine.shell(line, check=False)
            # timeout(1): 124 = interrupted; 137 = still running after 30 s.
            assert done.returncode in (0, 124), f"{line}: {done.returncode}\n{done.stderr}"
            # Python itself is not yet ready for Ctrl-C in its first milliseconds.
            if not done.stderr.startswith("Fatal Python error: init"):
                assert "Traceback" not in done.stderr, f"{line}: {done.stderr}"

    for verb in _LOOKING:
        interrupt(verb.format(port=port))
        runs_on(service, loop)
        wait_for(lambda: processes(machine) == living, f"the processes of {verb} to end")
    halves = machine.shell(f"find {_DESK} -name '*.part*' -o -name '.?*'").stdout
    assert not halves
    # Files under their final name are complete, or are recordings that can be opened.
    machine.shell(
        f"cd {_DESK} && python3 -c 'import json, pathlib, rtcf\n"
        'for each in pathlib.Path().glob("*.mcap"): rtcf.read_recording(str(each)).close()\n'
        'for each in pathlib.Path().glob("*.json"): json.loads(each.read_text())\n'
        'assert pathlib.Path("whole.mcap").exists()\''
    )
    wait_for(lambda: descriptors(service) <= before, "rtcfd to have as many descriptors as before")
    for verb in _ENDING:
        line = f"timeout -s INT -k 30 {draw.uniform(0.2, 0.6):.3f} rtcfctl {verb}"
        assert machine.shell(line, check=False).returncode != 137, line
    wait_for(lambda: service.status().get("state") == "stopped", "an executor")
    service.ctl("start")
    wait_for(lambda: service.iteration() > 10, "cycles")


def test_repeated_restarts_keep_the_loop_running(service: Service) -> None:
    before = service.load_and_start()
    service.machine.shell("for i in 1 2 3; do systemctl restart rtcfd & done; wait")
    runs_on(service, before)


def test_a_stop_during_restarts_is_final(service: Service) -> None:
    service.load_and_start()
    enough = "/var/tmp/enough"
    replacing = service.machine.start(
        "bash", "-c", f"while [ ! -e {enough} ]; do rtcfctl replace M; done"
    )
    try:
        for _ in range(3):
            service.ctl("start")
            service.ctl("stop")
            iteration = service.iteration()
            assert service.status()["state"] == "stopped"
            assert service.iteration() == iteration
    finally:
        service.machine.shell(f"touch {enough}")
        replacing.communicate(timeout=60)
        service.machine.shell(f"rm {enough}")
