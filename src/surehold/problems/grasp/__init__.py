"""Grasping as a problem: its options, variables and default poses."""
