"""People who do not wait."""

import random

from machine import wait_for
from rtcf_service import Service

# Each as somebody would leave it; what writes a file writes it here.
_DESK = "/var/tmp/desk"
_VERBS = (
    "status",
    "echo /M.out1",
    "hz /M.out1",
    "top",
    "logs -f",
    "events -f",
    "plot /M.out1",
    "wait 'M.out1 > 1e30' --timeout 20",
    "write /M.in1 2.5",
    "record --force -o recording.mcap",
    "trace --force -o trace.json --cycles 100000",
    "graph -o graph.dot",
    "stats --plot stats.svg",
    "metrics --listen 9777",
    "incident take",
    "check rtcf_examples Mimo",
    "run own.yaml",
    "apply own.yaml",
    "runner restart rt_runner",
)
_SEED = 7


def descriptors(service: Service) -> int:
    return len(service.machine.shell(f"ls /proc/{service.pid}/fd").stdout.split())


def test_a_verb_that_is_interrupted_ends_and_leaves_nothing(service: Service) -> None:
    machine = service.machine
    machine.shell(f"rm -rf {_DESK}; mkdir {_DESK}")
    service.load_and_start()
    machine.shell(f"cd {_DESK} && rtcfctl save own.yaml")
    before = descriptors(service)
    draw = random.Random(_SEED)
    for verb in _VERBS:
        for after_s in (draw.uniform(0.05, 0.5), draw.uniform(0.5, 1.5)):
            line = f"cd {_DESK} && timeout -s INT -k 30 {after_s:.3f} rtcfctl {verb}"
            done = machine.shell(line, check=False)
            # timeout(1): 124 as it was interrupted; 137 if it went on for 30 s all the same.
            assert done.returncode in (0, 124), f"{line}: {done.returncode}\n{done.stderr}"
            assert "Traceback" not in done.stderr, f"{line}: {done.stderr}"
    for nothing in ("pgrep --list-full rtcfctl", f"find {_DESK} -name '*.part*' -o -name '.?*'"):
        found = machine.shell(f"{nothing}; true").stdout
        assert not found, f"{nothing}: {found}"
    wait_for(lambda: descriptors(service) <= before, "rtcfd to have as many descriptors as before")
    service.ctl("start", check=False)
    wait_for(lambda: service.status()["state"] == "running", "the loop")
    service.ctl("stop")
