"""Closing the hand: gaps, first contacts, soft touch."""
