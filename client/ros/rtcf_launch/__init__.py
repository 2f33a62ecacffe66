"""What the nodes rt_runner and rt_launcher and the rosrun tools of the ROS package `rtcf` are
made of.  They are processes of a launch but no ROS nodes: rospy would wait for a master
where they are to end, so they talk to it themselves, with a limit for each call."""
