"""Scenes of a grasp as triangle meshes, for whoever draws them."""
