"""Files that several processes share: one lock, one way to write a file whole, compiled code kept on disk."""
