"""The upgrade of a machine to the next Debian, with rtcf's next release: loops run until the
reboot, and are restored except for components that must be rebuilt."""

import hashlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from machine import Machine, wait_for
from rtcf_service import SETTINGS, Service

pytestmark = pytest.mark.long

_TREE = Path(__file__).parents[2]
_HOUR_S = 3600.0

# A user's own component package, built like debian/tests/build-component.
_BUILD = r"""
set -e
rm -rf /srv/build
cmake -S /srv/offset -B /srv/build -DCMAKE_INSTALL_PREFIX=/usr
cmake --build /srv/build
"""
_PACKAGE = r"""
DESTDIR=/srv/package cmake --install /srv/build
mkdir -p /srv/package/DEBIAN
cat >/srv/package/DEBIAN/control <<.
Package: lab-offset
Version: 1
Architecture: amd64
Maintainer: Lab <lab@example.org>
Depends: rtcfd
Description: component of a laboratory
.
dpkg-deb --build /srv/package /srv/lab-offset.deb
apt-get install --yes --quiet /srv/lab-offset.deb
"""

_ARM = """\
runner: arm
settings: {frequency_hz: 200, on_boot: start}
components:
  - {name: wave, package: rtcf_examples, type: Wave, parameters: {amplitude: 3.5}}
  - {name: offset, package: offset, type: Offset, parameters: {offset: 2.5}}
"""
_LIMITS = "[limits]\nclients = 123\n"

_FULL_UPGRADE = r"""
set -e
apt-get --quiet update
apt-get --quiet --yes full-upgrade
"""


def _output(*command: str, **environment: str) -> str:
    done = subprocess.run(
        command, cwd=_TREE, env=os.environ | environment, stdout=subprocess.PIPE, text=True,
        check=True,
    )  # fmt: skip
    return done.stdout.strip()


@pytest.fixture(scope="module")
def releases() -> tuple[str, str]:
    """The two newest Debian releases that rtcf supports, the older one first."""
    older, newer = _output("tools/release", "list").split()[-2:]
    return older, newer


@pytest.fixture(scope="module")
def older(releases: tuple[str, str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    """A booted machine of the older Debian with rtcf's packages and a user's package."""
    debs = _output("tests/system/packages", releases[0])
    root = _output("tests/system/root", releases[0], RTCF_DEBS=debs)
    name = os.environ["RTCF_SYSTEM_NAME"] + "-older"
    machine = Machine(Path(root), name, tmp_path_factory.mktemp("older"))
    machine.boot()
    _copy_debs(Path(debs), machine.path("/debs"))
    machine.shell("apt-get install --yes --quiet /debs/*.deb")
    source = machine.path("/srv/offset")
    source.mkdir()
    for file in (_TREE / "debian" / "tests" / "offset").iterdir():
        (source / file.name).write_bytes(file.read_bytes())
    machine.shell(_BUILD + _PACKAGE)
    yield machine
    machine.stop()


@pytest.fixture(scope="module")
def newer_debs(releases: tuple[str, str]) -> Path:
    """Packages for the newer Debian, of a release for which components must be rebuilt;
    those in the folder RTCF_NEXT_DEBS if it is set, since building them takes a while."""
    given = os.environ.get("RTCF_NEXT_DEBS")
    return Path(given or _output("tests/system/packages", releases[1], "next"))


def _copy_debs(debs: Path, folder: Path) -> None:
    folder.mkdir()
    for deb in debs.glob("*.deb"):
        if "-dbgsym_" not in deb.name:
            (folder / deb.name).write_bytes(deb.read_bytes())


def _offer(machine: Machine, debs: Path, release: str) -> None:
    """Set the machine's sources to a release, with rtcf's packages for it."""
    folder = machine.path("/newer")
    _copy_debs(debs, folder)
    with (folder / "Packages").open("w") as index:
        for deb in folder.glob("*.deb"):
            print(_output("dpkg-deb", "--field", str(deb)), file=index)
            print(f"Filename: ./{deb.name}\nSize: {deb.stat().st_size}", file=index)
            print(f"SHA256: {hashlib.sha256(deb.read_bytes()).hexdigest()}\n", file=index)
    sources = _output("tools/release", "sources", release)
    ours = "deb [trusted=yes] file:/newer ./"
    machine.path("/etc/apt/sources.list").write_text(f"{sources}\n{ours}\n")


def _status(service: Service, runner: str) -> tuple[str, int]:
    status = service.status(runner)
    return status["state"], int(status.get("components", 0))


def test_loops_are_restored_except_for_components_to_rebuild(
    older: Machine, newer_debs: Path, releases: tuple[str, str]
) -> None:
    service = Service(older)
    service.configure(_LIMITS)
    older.path("/etc/rtcfd/graphs.d/arm.yaml").write_text(_ARM)
    service.systemctl("restart", "rtcfd.service")
    service.ctl("runner", "set", "--frequency", "250", "--on-boot", "resume")
    service.load_and_start()
    service.ctl("load", "rtcf_examples", "Wave", "--name", "W", "--param", "amplitude:=0.25")
    service.ctl("set", "W", "rate:=2.5")
    service.ctl("runner", "add", "idle", "--on-boot", "resume")
    service.ctl("-r", "idle", "load", "rtcf_examples", "Mimo")
    service.ctl("-r", "arm", "start")
    before = {name: service.status(name) for name in ("rt_runner", "arm")}
    assert _status(service, "arm") == ("running", 2)

    _offer(older, newer_debs, releases[1])
    older.shell(_FULL_UPGRADE, deadline_s=_HOUR_S)
    version = older.run("dpkg-query", "-W", "-f", "${Version}", "rtcfd").stdout
    assert version.endswith("+next" + _output("tools/release", "version", releases[1]))
    for name, status in before.items():
        after = service.status(name)
        assert (after["realtime_tid"], after["state"]) == (status["realtime_tid"], "running")
        assert int(after["iteration"]) > int(status["iteration"])
    assert "restart pending: rtcfd was upgraded" in service.ctl("status").stdout

    older.reboot()
    assert f"VERSION_CODENAME={releases[1]}" in older.path("/etc/os-release").read_text()
    wait_for(lambda: service.unit_property("ActiveState") == "active", "the service")
    assert older.path(SETTINGS).read_text().endswith(_LIMITS)
    assert older.path("/etc/rtcfd/graphs.d/arm.yaml").read_text() == _ARM

    assert _status(service, "rt_runner") == ("running", 2)
    assert service.status()["chosen"]["frequency_hz"] == 250
    said = service.ctl("info", "W").stdout
    assert "0.25" in said
    assert "2.5" in said
    assert _status(service, "idle") == ("stopped", 1)

    assert _status(service, "arm") == ("faulted", 1)
    said = service.ctl("-r", "arm", "status").stdout
    assert "not resumed: left out of its loop: /offset; " in said
    why = [line for line in said.splitlines() if "is left out: " in line]
    assert len(why) == 1
    assert "offset is left out: " in why[0]
    assert "was built for component ABI" in why[0]
    assert "build it again with librtcf-dev" in why[0]
    errors = [str(entry["MESSAGE"]) for entry in service.journal("PRIORITY=3")]
    assert sum("offset is left out of the loop: " in error for error in errors) == 1

    older.shell(_BUILD + "cmake --install /srv/build")
    service.ctl("-r", "arm", "release", "offset")
    service.ctl("-r", "arm", "start")
    assert _status(service, "arm") == ("running", 2)
