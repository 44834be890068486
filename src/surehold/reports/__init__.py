"""Pictures and pages of runs: they take data and start nothing."""
