"""Recordings to kinematics: what the joint did."""
