"""What a trial is worth: the formulas, what they are averaged over, and where a trial tells most."""
