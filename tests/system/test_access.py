"""Access rights: group rtcf, [access], trusted component folders, limits."""

import pytest
from machine import wait_for
from rtcf_service import Service

LEVELS = '[access]\ndefault = "none"\nobserve = ["alice"]\noperate = ["bob"]\nadmin = ["@boss"]\n'
CHANGES = (
    ("start",),
    ("stop",),
    ("load", "rtcf_examples", "Mimo", "--name", "X"),
    ("unload", "M"),
    ("replace", "M", "rtcf_examples", "Identity"),
    ("break", "M.in1"),
    ("runner", "add", "other"),
    ("runner", "set", "--frequency", "10"),
    ("runner", "remove", "rt_runner"),
    ("runner", "restart", "rt_runner"),
    ("stats", "--reset"),
)
QUERIES = (("status",), ("list",), ("order",), ("info", "M"), ("connections",), ("stats",),
           ("types",), ("runner", "list"))  # fmt: skip


@pytest.fixture
def levels(service: Service) -> Service:
    service.machine.shell("getent group boss || groupadd boss; gpasswd -a carol boss >/dev/null")
    service.configure(LEVELS)
    service.systemctl("restart", "rtcfd.service")
    service.load_and_start()
    return service


def test_a_user_outside_the_group_gets_advice(service: Service) -> None:
    done = service.ctl("status", user="mallory", check=False)
    assert done.returncode == 3
    assert done.stderr == (
        "rtcfctl: permission denied on /run/rtcfd/control.sock: join its group "
        "(`sudo adduser mallory rtcf`) and log in again\n"
    )


def test_an_observer_sees_everything_and_changes_nothing(levels: Service) -> None:
    before = levels.status()
    for query in QUERIES:
        levels.ctl(*query, user="alice")
    for change in CHANGES:
        done = levels.ctl(*change, user="alice", check=False)
        assert done.returncode == 1, change
        assert "user alice has only the right to observe" in done.stderr, change
        assert "under [access]" in done.stderr, change
    after = levels.status()
    assert (after["pid"], after["state"], after["generation"]) == (
        before["pid"], before["state"], before["generation"],
    )  # fmt: skip
    levels.wait_until_said("Load by alice (uid ")


def test_an_observer_wakes_rtcfd_up_and_starts_no_loop(levels: Service) -> None:
    levels.ctl("runner", "set", "--on-boot", "resume")
    levels.systemctl("stop", "rtcfd.service")
    assert levels.unit_property("ActiveState", "rtcfd.socket") == "active"
    wait_for(
        lambda: levels.ctl("order", user="alice").stdout.split() == ["/M"], "the graph to be there"
    )
    wait_for(lambda: levels.unit_property("ActiveState") == "active", "rtcfd to be up")
    assert levels.status()["state"] == "stopped"
    assert not levels.said("loop resumed")
    # A user with the right `operate` starts it.
    levels.ctl("start", user="bob")
    assert levels.status()["state"] == "running"


def test_an_operator_runs_loops_but_loads_no_code(levels: Service) -> None:
    levels.ctl("stop", user="bob")
    levels.ctl("start", user="bob")
    for change in (("load", "rtcf_examples", "Mimo", "--name", "X"), ("runner", "add", "other")):
        done = levels.ctl(*change, user="bob", check=False)
        assert done.returncode == 1
        assert "requires the right to administer" in done.stderr


def test_a_member_of_an_admin_group_does_everything(levels: Service) -> None:
    levels.ctl("load", "rtcf_examples", "Identity", "--name", "X", user="carol")


def test_rights_follow_a_reload(levels: Service) -> None:
    levels.configure('[access]\nadmin = ["alice"]\n')
    levels.systemctl("reload", "rtcfd.service")
    levels.ctl("unload", "M", user="alice")


# Libraries to link against: in a world-writable folder, and in one owned by root.
_LIBRARIES = r"""
mkdir -p /srv/open /srv/root; chmod 777 /srv/open
# Its constructor ends the process, so the expected error shows that it did not run.
cat >/srv/open/helps.c <<END
#include <unistd.h>
__attribute__((constructor)) static void run(void) { _exit(77); }
END
gcc -shared -o /srv/open/libhelps.so /srv/open/helps.c
install -o alice /srv/open/libhelps.so /srv/root/
empty="gcc -shared -nostartfiles -Wl,--no-as-needed -x c /dev/null -x none"
$empty -o /srv/root/libgood.so
$empty -o /srv/root/libchain.so -Wl,-rpath,/srv/open -L/srv/open -lhelps
"""


def untrusted(service: Service, make: str) -> str:
    """Load from a package folder created by a shell command; return the error."""
    make = make.replace("{ln}", "$empty -o $t")
    service.machine.shell(
        "set -e; d=$(echo /usr/lib/*-linux-gnu/rtcf); rm -rf $d/evil; mkdir $d/evil; "
        f"s=$(ls $d/rtcf_examples/*.so); t=$d/evil/evil.so; o=/srv/open; {_LIBRARIES}{make}"
    )
    try:
        done = service.ctl("load", "evil", "Mimo", check=False)
        assert done.returncode == 1, done.stdout
        return done.stderr
    finally:
        service.machine.shell(
            "rm -rf /usr/lib/*-linux-gnu/rtcf/evil /srv/evil.so /srv/open /srv/root"
        )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        ("cp $s $t; chown alice $t", "evil.so belongs to user alice"),
        ("cp $s $t; chmod o+w $t", "evil.so can be written by everybody"),
        ("cp $s $t; chown :rtcf $t; chmod g+w $t", "evil.so can be written by its group"),
        ("cp $s $t; chown alice $d/evil", "rtcf/evil belongs to user alice"),
        ("cp $s $t; chmod o+w $d/evil", "rtcf/evil can be written by everybody"),
        ("cp $s /srv/evil.so; chown alice /srv/evil.so; ln -s /srv/evil.so $t",
         "/srv/evil.so belongs to user alice"),
        ("{ln} -Wl,-rpath,/srv/open -L$o -lhelps", "/srv/open can be written by everybody"),
        ("{ln} -Wl,-rpath,/usr/../srv/open -L$o -lhelps", "/srv/open can be written by everybody"),
        ("{ln} -Wl,-rpath,/srv/open/none -L$o -lhelps", "/srv/open can be written by everybody"),
        ("{ln} -Wl,-rpath,/tmp -Wl,--disable-new-dtags", "/tmp can be written by everybody"),
        ("{ln} -Wl,-rpath,lib", 'its run path contains "lib", which is not an absolute path'),
        ("{ln} $o/libhelps.so", "which links against /srv/open/libhelps.so: /srv/open can be"),
        ("{ln} -Wl,-rpath,/srv/root -L/srv/root -lhelps",
         "which links against /srv/root/libhelps.so: /srv/root/libhelps.so belongs to user alice"),
        ("{ln} -Wl,-rpath,/srv/root -L/srv/root -lchain", "/srv/open can be written by everybody"),
        ("mkfifo $t", "not a regular file"),
        ("mkdir $t", "not a regular file"),
    ],
)  # fmt: skip
def test_writable_code_is_rejected(service: Service, make: str, said: str) -> None:
    error = untrusted(service, make)
    assert said in error
    assert len(error.splitlines()) == 1
    # The advice must not widen rights, and must not touch /tmp or a home.
    assert "chmod" not in error and "chown" not in error


def test_code_linked_to_trusted_folders_is_loaded(service: Service) -> None:
    error = untrusted(service, "{ln} -Wl,-rpath,/srv/root -L/srv/root -lgood -lm")
    # It has no components, but it was loaded.
    assert "has no components" in error


@pytest.mark.parametrize("name", ["../etc", "/etc", "..", "rtcf_examples/../x", "a b", "a\n"])
def test_paths_are_rejected_as_package_names(service: Service, name: str) -> None:
    done = service.ctl("load", name, "Mimo", check=False)
    assert done.returncode != 0
    assert "is not valid" in done.stderr


def test_a_workspace_in_the_settings_is_trusted_for_its_owner(service: Service) -> None:
    service.machine.shell(
        "install -d -o alice -g alice /srv/ws /srv/ws/evil; "
        "install -o alice -g alice /usr/lib/*-linux-gnu/rtcf/rtcf_examples/*.so /srv/ws/evil/e.so"
    )
    assert service.ctl("load", "evil", "Mimo", check=False).returncode == 1
    settings = service.machine.path("/etc/rtcfd/rtcfd.toml")
    settings.write_text(settings.read_text().replace("[daemon]", '[daemon]\npath = ["/srv/ws"]'))
    service.systemctl("reload", "rtcfd.service")
    service.ctl("load", "evil", "Mimo", "--name", "E")
    service.machine.run("chown", "bob", "/srv/ws/evil/e.so")
    done = service.ctl("load", "evil", "Mimo", "--name", "F", check=False)
    assert "belongs to user bob" in done.stderr
    service.machine.run("rm", "-r", "/srv/ws")


def test_exceeded_limits_are_rejected_with_advice(service: Service) -> None:
    service.configure("[limits]\nrunners = 1\ncomponents = 1\nclients = 2\ntaps = 1\n")
    service.systemctl("restart", "rtcfd.service")
    service.load_and_start()
    done = service.ctl("runner", "set", "--whitelist", ".*", check=False)
    assert done.returncode == 1
    assert "2 published outputs (taps) are more than the 1 allowed" in done.stderr
    assert "raise taps under [limits]" in done.stderr
    service.ctl("runner", "set", "--whitelist", ".*1")
    done = service.ctl("runner", "add", "other", check=False)
    assert "2 runners are more than the 1 allowed: raise runners under [limits]" in done.stderr
    done = service.ctl("load", "rtcf_examples", "Identity", check=False)
    assert "raise components under [limits]" in done.stderr
    watching = [service.machine.start("rtcfctl", "stats", "--watch") for _ in range(2)]
    for each in watching:
        assert each.stdout is not None
        each.stdout.readline()  # served
    done = service.ctl("status", check=False)
    assert done.returncode == 1
    assert "rtcfd serves 2 clients already" in done.stderr
    service.machine.run("pkill", "-f", "stats --watch")
    for each in watching:
        each.communicate()
    wait_for(lambda: service.ctl("status", check=False).returncode == 0, "room for a client")


def test_a_reload_keeps_folder_permissions(service: Service) -> None:
    folders = [f"/run/rtcfd/{each}" for each in ("executors", "stop", "cpus")]
    ask = ("stat", "-c", "%a %U:%G", *folders)
    closed = ["700 rtcf:rtcf", "750 rtcf:rtcf", "700 rtcf:rtcf"]
    service.load_and_start()
    assert service.machine.run(*ask).stdout.splitlines() == closed
    service.systemctl("reload", "rtcfd.service")
    assert service.machine.run(*ask).stdout.splitlines() == closed
    note = "/run/rtcfd/executors/handover.json"
    assert service.machine.run("cat", note, user="alice", check=False).returncode != 0
    modes = service.machine.shell("stat -c %a /run/rtcfd/executors/*.json").stdout.split()
    assert modes == ["600"]


def test_a_group_member_cannot_claim_cpus(service: Service) -> None:
    before = service.load_and_start()
    service.ctl("stop")
    # Former names of CPU claims, and their files today: a group member can create neither.
    take = (
        "import os, socket, time\n"
        "kept = []\n"
        "for cpu in range(64):\n"
        "    kept.append(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))\n"
        "    kept[-1].bind(f'\\0rtcf-loop-cpu-{cpu}')\n"
        "    try:\n"
        "        os.open(f'/run/rtcfd/cpus/cpu-{cpu}', os.O_RDWR | os.O_CREAT)\n"
        "        print('taken', flush=True)\n"
        "    except PermissionError:\n"
        "        pass\n"
        "print('ready', os.getpid(), flush=True)\n"
        "time.sleep(1000)\n"
    )
    holder = service.machine.start("/usr/bin/python3", "-c", take, user="alice")
    assert holder.stdout is not None
    said, pid = holder.stdout.readline().split()
    try:
        assert said == "ready"
        service.ctl("start")
        after = service.status()
        assert after.get("loop_cpu") == before.get("loop_cpu")
        assert not any("also runs another loop" in line for line in after.get("degraded", []))
    finally:
        service.machine.run("kill", pid)
        holder.communicate()
