"""Models by name, readers, cameras, subdivision, generators."""
