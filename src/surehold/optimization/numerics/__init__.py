"""Arithmetic that several rooms need."""
