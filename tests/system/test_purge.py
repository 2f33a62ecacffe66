"""Removing the packages; the last file of this folder, as nothing is left for others."""

from pathlib import Path

from installed import run

PACKAGES = ("librtcf-dev", "python3-rtcf", "ros-rtcf", "rtcf-check", "rtcf-components", "rtcfctl",
            "rtcfd")  # fmt: skip


def test_purge_leaves_nothing() -> None:
    # Built by another test; no package owns it.
    run("rm", "-rf", "/usr/lib/x86_64-linux-gnu/rtcf/offset")
    run("dpkg", "--purge", *PACKAGES)
    left = [
        str(path)
        for root in ("/usr", "/etc", "/var/lib", "/run")
        for path in Path(root).rglob("*rtcf*")
        if "dpkg" not in path.parts
    ]
    assert left == []
