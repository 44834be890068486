"""The largest ball in the convex hull of wrenches."""
