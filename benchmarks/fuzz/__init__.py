"""Strange input against the public calls, the readers of files and the service: `python -m benchmarks.fuzz`."""
