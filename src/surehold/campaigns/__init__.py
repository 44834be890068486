"""Many runs: plans, their execution, comparison by statistics. The floor is laid; nothing stands on it yet."""
