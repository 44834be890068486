"""What a trial must satisfy besides being good: limits of its inputs, of further outputs, and that it does not fail."""
