"""Commands in messages that a node of a launch prints."""

import pytest
from rtcf_launch.hints import fitted


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        (
            "/a: raise the limit: rtcfctl runner set rt_runner --largest-message KIB",
            "/a: raise the limit: rt_runner's ~ros_largest_message_kB KIB",
        ),
        (
            "no real time: x; to run degraded: rtcfctl runner set rt_runner --realtime preferred",
            "no real time: x; to run degraded: rt_runner's ~realtime preferred",
        ),
        (
            "read the previous cycle: `rtcfctl break R3.in1 R3.in2 H1.in`, or loading R1 with "
            "`--break in`",
            "read the previous cycle: ~topics_ignore_for_graph or ~is_first of R3, H1, or "
            "~topics_ignore_for_graph or ~is_first of R1",
        ),
        ("stop it first: rtcfctl -r arm stop", "stop it first: rtcfctl -r arm stop"),
    ],
)
def test_settings_are_named_by_parameters(text: str, printed: str) -> None:
    assert fitted(text, "") == printed


def test_commands_name_the_socket_of_a_private_daemon() -> None:
    text = "see `rtcfctl status`, or rtcfctl -r arm stop; rtcfctl"
    assert fitted(text, "/tmp/s") == (
        "see `rtcfctl --socket /tmp/s status`, or rtcfctl --socket /tmp/s -r arm stop; rtcfctl"
    )
    assert fitted(text, "") == text
