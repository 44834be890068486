"""A node that explores with a study of surehold."""
