"""The nodes rt_runner and rt_launcher, and the rosrun tools of the ROS package `rtcf`.

The two nodes do not use rospy, which waits for a master at its end.  They call the master
themselves, with a timeout for each call.
"""
