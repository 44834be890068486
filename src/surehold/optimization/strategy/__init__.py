"""Ways to choose the next trial, one a file."""
