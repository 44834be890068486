"""Local-global processes: rough around a center that is learnt, smooth elsewhere."""
