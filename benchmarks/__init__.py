"""Measurements that anyone can repeat: `make bench` runs the short ones and prints one table each."""
