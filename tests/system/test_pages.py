"""The commands of README, docs and manual pages, in a Debian with rtcf's packages."""

import json
import re

import pages
from rtcf_service import Service


def type_in(service: Service, lines: list[list[str]]) -> None:
    """Run rtcfctl commands as a user with all rights."""
    for words in lines:
        service.ctl(*words[1:], user="alice")


def test_the_tour_runs_as_documented(service: Service) -> None:
    type_in(service, pages.tour())
    assert "on_boot: start" in service.machine.shell("cat /tmp/tour.yaml").stdout
    service.ctl("stop")


def test_the_example_of_rtcfctl_runs(service: Service) -> None:
    type_in(service, pages.commands("rtcfctl.1"))
    assert service.status()["state"] == "running"


def test_the_graph_of_the_example_is_applied_at_boot(service: Service) -> None:
    graph = service.machine.path("/etc/rtcfd/graphs.d/example.yaml")
    graph.write_text(pages.example("rtcf-graph.5"))
    service.stop_and_start()
    assert service.ctl("order").stdout.split()[-1] == "/B"


def test_the_settings_of_the_example_are_accepted(service: Service) -> None:
    # Replaces our settings for a container.
    service.machine.path("/etc/rtcfd/rtcfd.toml").write_text(pages.example("rtcfd.toml.5"))
    service.systemctl("reload", "rtcfd")
    assert service.status()["settings"]["frequency_hz"] == 2000


def test_the_program_of_the_example_runs(service: Service) -> None:
    done = service.machine.run(
        "/usr/bin/python3", "-c", pages.example("rtcf-protocol.7"), user="alice"
    )
    float(done.stdout)


def test_a_graph_is_loaded_at_boot_as_documented(service: Service) -> None:
    service.ctl("load", "rtcf_examples", "Mimo", "--name", "M")
    for line in pages.shell_lines((pages.TREE / "docs" / "boot.md").read_text()):
        # Root needs no sudo, and a container may not have it.
        service.machine.shell(re.sub(r"^sudo ", "", line))
    assert service.machine.path("/etc/rtcfd/graphs.d/arm.yaml").is_file()


def test_parameter_changes_are_listed_and_undone_as_documented(service: Service) -> None:
    service.ctl("load", "rtcf_examples", "Wave", "--name", "wave", "--param", "amplitude:=1.5")
    service.ctl("set", "wave", "amplitude:=2.5", user="alice")
    for line in pages.shell_lines((pages.TREE / "docs" / "security.md").read_text()):
        service.machine.shell(line)
    info = json.loads(service.ctl("-o", "json", "info", "wave").stdout)
    (amplitude,) = [each for each in info["parameters"] if each["name"] == "amplitude"]
    assert amplitude["value"] == 1.5
    shown = service.ctl("history", "wave").stdout
    assert re.search(r"alice +set +/wave.amplitude +1.5 +2.5", shown), shown
    assert re.search(r"root +undo +/wave.amplitude +2.5 +1.5", shown), shown
