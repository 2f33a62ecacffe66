"""Messages and services of RTCF 2021, whose MD5 sums its bags, scripts and peers rely on."""

import pytest
from genmsg.gentools import compute_md5
from genmsg.msg_loader import MsgContext, load_depends, load_msg_from_file, load_srv_from_file
from pages import TREE

FOLDER = TREE / "proto" / "rtcf_msgs"
SEARCH = {"rtcf_msgs": [str(FOLDER / "msg")], "std_msgs": ["/usr/share/std_msgs/msg"]}

MESSAGES = {
    "ComponentInfo": "0b3f1584817cbebc3083ef7c6ed5ef6a",
    "ConnectionInfo": "e6f5aa6ea0472b18aa5d236a6bcd4b03",
    "IterationInfo": "101315717d3f87d44449798b0172d5d8",
    "Mapping": "040969a921fb5fc6a1cc987a2a4dce8c",
    "PortInfo": "cbcc7226a94ac3791d8b53a1cb90a73d",
    "RunnerInfo": "b26691b5d02fb88b6f36dae05f5df1b6",
}
SERVICES = {
    "GetRunnerInfo": "9a729ad690d638a65379b81e227506ba",
    "LoadOrocosComponent": "9f41735dd4e71d4ad010681b88014a9e",
    "UnloadOrocosComponent": "929d3fc95e6bf856d80cce3d214e81cc",
}


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_of_rtcf_2021_keeps_its_md5_sum(name: str) -> None:
    context = MsgContext.create_default()
    file = FOLDER / "msg" / f"{name}.msg"
    message = load_msg_from_file(context, str(file), f"rtcf_msgs/{name}")
    load_depends(context, message, SEARCH)
    assert compute_md5(context, message) == MESSAGES[name]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_of_rtcf_2021_keeps_its_md5_sum(name: str) -> None:
    context = MsgContext.create_default()
    file = FOLDER / "srv" / f"{name}.srv"
    service = load_srv_from_file(context, str(file), f"rtcf_msgs/{name}")
    for half in (service.request, service.response):
        load_depends(context, half, SEARCH)
    assert compute_md5(context, service) == SERVICES[name]
