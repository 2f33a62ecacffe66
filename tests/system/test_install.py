"""State of a machine with systemd after the packages are installed."""

import pytest
from machine import Machine
from rtcf_service import Service

MAN_PAGES = ("rtcfctl.1", "rtcfd.8", "rtcf-executor.8", "rtcfd.toml.5", "rtcf-graph.5",
             "rtcf-protocol.7", "rtcf-compile.1", "rtcf-scope.8")  # fmt: skip


def test_installing_them_starts_the_service(machine: Machine) -> None:
    for unit in ("rtcfd.service", "rtcfd.socket"):
        assert machine.run("systemctl", "is-active", unit).stdout.strip() == "active"
        assert machine.run("systemctl", "is-enabled", unit).stdout.strip() == "enabled"


def test_the_settings_as_shipped_are_accepted(machine: Machine) -> None:
    assert machine.path("/etc/rtcfd/rtcfd.toml").is_file()
    assert "rt_runner" in machine.run("rtcfctl", "status").stdout


def test_user_and_group_are_created(machine: Machine) -> None:
    entry = machine.run("getent", "passwd", "rtcf").stdout.strip().split(":")
    assert machine.run("getent", "group", entry[3]).stdout.startswith("rtcf:")
    assert entry[6] == "/usr/sbin/nologin"


def test_the_control_socket_belongs_to_root_and_the_group(machine: Machine) -> None:
    found = machine.run("stat", "-c", "%A %U:%G", "/run/rtcfd/control.sock", "/run/rtcfd").stdout
    assert found.splitlines() == ["srw-rw---- root:rtcf", "drwxr-xr-x root:root"]


def test_units_are_valid(machine: Machine) -> None:
    units = ("rtcfd.service", "rtcfd.socket", "rtcf-scope.service", "rtcf-metrics.service")
    done = machine.run("systemd-analyze", "verify", *units)
    assert "rtcf" not in done.stderr


def test_the_service_has_a_low_exposure_score(machine: Machine) -> None:
    machine.run("systemd-analyze", "security", "--threshold=30", "rtcfd.service")
    machine.run("systemd-analyze", "security", "--threshold=20", "rtcf-scope.service")
    machine.run("systemd-analyze", "security", "--threshold=20", "rtcf-metrics.service")


def test_metrics_are_off_by_default(machine: Machine) -> None:
    state = machine.run("systemctl", "is-enabled", "rtcf-metrics.service", check=False).stdout
    assert state == "disabled\n"
    try:
        machine.run("systemctl", "start", "rtcf-metrics.service")
        ask = (
            "until /usr/bin/python3 -c 'import urllib.request as u;"
            'print(u.urlopen("http://127.0.0.1:9464/metrics").read().decode())'
            "' 2>/dev/null; do sleep 0.2; done"
        )
        assert 'rtcf_runner_state{runner="rt_runner"' in machine.shell(ask).stdout
    finally:
        machine.run("systemctl", "stop", "rtcf-metrics.service")


def test_the_scope_is_off_by_default(machine: Machine) -> None:
    state = machine.run("systemctl", "is-enabled", "rtcf-scope.service", check=False).stdout
    assert state == "disabled\n"
    try:
        machine.run("systemctl", "start", "rtcf-scope.service")
        token = machine.path("/var/lib/rtcf-scope/token").read_text().strip()
        about = "http://127.0.0.1:8642/api/about"
        headers = {"Authorization": f"Bearer {token}"}
        ask = (
            "import urllib.request as u;"
            f"print(u.urlopen(u.Request('{about}', headers={headers})).read())"
        )
        assert "rt_runner" in machine.run("/usr/bin/python3", "-c", ask).stdout
    finally:
        machine.run("systemctl", "stop", "rtcf-scope.service")


@pytest.mark.parametrize("page", MAN_PAGES)
def test_each_program_and_file_has_a_man_page(machine: Machine, page: str) -> None:
    section = page.rpartition(".")[2]
    assert machine.path(f"/usr/share/man/man{section}/{page}.gz").is_file()


def test_only_root_can_write_component_libraries(machine: Machine) -> None:
    assert machine.shell("ls /usr/lib/*/rtcf/*/*.so").stdout
    assert not machine.shell("find /usr/lib/*/rtcf ! -user root -o -perm /022 ! -type l").stdout


def test_ros_finds_the_packages(machine: Machine) -> None:
    for name in ("rtcf", "rtcf_msgs"):
        code = f"import rospkg; print(rospkg.RosPack().get_path('{name}'))"
        done = machine.run("/usr/bin/python3", "-c", code)
        assert done.stdout.strip() == f"/usr/share/{name}"


def test_messages_are_python_modules(machine: Machine) -> None:
    code = "from rtcf_msgs.msg import IterationInfo; IterationInfo()"
    machine.run("/usr/bin/python3", "-c", code)


def test_check_executor_is_a_sanitizer_build(machine: Machine) -> None:
    executor = machine.path("/usr/lib/rtcf/rtcf-executor-rtsan")
    assert b"RealtimeSanitizer" in executor.read_bytes()


def test_the_unit_has_the_limits_that_a_loop_needs(service: Service) -> None:
    # As configured: a container cannot raise them.
    assert service.unit_property("LimitMEMLOCK") == "infinity"
    assert service.unit_property("LimitRTPRIO") == "99"
    assert service.unit_property("AmbientCapabilities") == "cap_ipc_lock cap_sys_nice"
    assert service.unit_property("CPUSchedulingPolicy") == "0"
    assert service.unit_property("OOMScoreAdjust") == "-900"
