"""The rosrun tools print the same as RTCF 2021's.

rtcf_2021_tools.txt is the output of its five unmodified scripts for the same launch: each
command after a `$`, followed by its output.
"""

import shlex
from pathlib import Path

from daemon_process import wait_for
from launch_processes import Launching
from ros_processes import Master

GOLDEN = Path(__file__).with_name("rtcf_2021_tools.txt")
DONE = 0
LAUNCH = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <param name="num_components_expected" value="3"/>
    <param name="ros_mapping_whitelist" value="/signal"/>
  </node>
  <node name="wave" pkg="rtcf" type="rt_launcher" args="rtcf_examples Wave">
    <remap from="wave" to="/signal"/>
  </node>
  <group ns="arm">
    <node name="a" pkg="rtcf" type="rt_launcher" args="rtcf_examples Identity">
      <remap from="in" to="/signal"/>
      <remap from="out" to="same"/>
    </node>
    <node name="b" pkg="rtcf" type="rt_launcher" args="rtcf_examples Identity">
      <remap from="in" to="same"/>
      <remap from="out" to="unread"/>
    </node>
  </group>
</launch>
"""


def test_the_tools_print_the_same_as_in_rtcf_2021(launching: Launching, master: Master) -> None:
    launch = launching.launch_text(LAUNCH)
    launch.wait_for_output("the loop runs with 3 components")
    wait_for(lambda: "/rt_runner/get_introspection_information" in master.services(), "it")
    sections = GOLDEN.read_text().split("$ ")[1:]
    assert len(sections) == 10
    for section in sections:
        command, _, wanted = section.partition("\n")
        told = launching.tool(*shlex.split(command))
        assert (told.stdout, told.stderr) == (wanted, ""), command
    assert launch.end() == DONE
