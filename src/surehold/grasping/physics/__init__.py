"""A second opinion on a grasp by rigid-body dynamics."""
