"""What is grasped: shipped objects, meshes, and their distance fields."""
