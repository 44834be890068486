"""Runs that survive: storage, workers, robots that answer late. The floor is laid; nothing stands on it yet."""
