"""What is there once the packages are installed."""

import grp
import pwd
import stat
from pathlib import Path

import pytest
from installed import Daemon, run


def test_user_and_group_are_made() -> None:
    user = pwd.getpwnam("rtcf")
    assert grp.getgrgid(user.pw_gid).gr_name == "rtcf"
    assert user.pw_shell == "/usr/sbin/nologin"


def test_unit_is_valid() -> None:
    assert run("systemd-analyze", "verify", "rtcfd.service").stderr == ""


def test_settings_as_shipped_are_accepted(daemon: Daemon) -> None:
    # The daemon of the fixture reads /etc/rtcfd/rtcfd.toml.
    assert Path("/etc/rtcfd/rtcfd.toml").is_file()
    assert "rt_runner" in daemon.ctl("status")


@pytest.mark.parametrize("page", ["rtcfctl.1", "rtcfd.8", "rtcf-executor.8"])
def test_each_program_has_a_man_page(page: str) -> None:
    name, section = page.rsplit(".", 1)
    assert Path(f"/usr/share/man/man{section}/{page}.gz").is_file()
    assert name


def test_component_libraries_are_roots_alone() -> None:
    libraries = list(Path("/usr/lib").glob("*/rtcf/*/*.so"))
    assert libraries
    for library in libraries:
        found = library.stat()
        assert found.st_uid == 0
        assert not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def test_ros_finds_the_packages() -> None:
    for name in ("rtcf", "rtcf_msgs"):
        code = f"import rospkg; print(rospkg.RosPack().get_path('{name}'))"
        assert run("/usr/bin/python3", "-c", code).stdout.strip() == f"/usr/share/{name}"


def test_messages_are_python_modules() -> None:
    run("/usr/bin/python3", "-c", "from rtcf_msgs.msg import IterationInfo; IterationInfo()")


def test_check_executor_is_a_sanitizer_build() -> None:
    executor = Path("/usr/lib/rtcf/rtcf-executor-rtsan")
    assert b"RealtimeSanitizer" in executor.read_bytes()
