"""Tests of `hybridyn/ros`: what needs no ROS, then the node in a process of its own."""
