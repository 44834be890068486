"""Models of the response; each answers for its own observation noise."""
