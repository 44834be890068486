"""The shape of an object that nobody has a mesh of: from a point cloud, from touch, or from both."""
