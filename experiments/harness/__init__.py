"""What experiments share: their registry, results and cells, processes that run them, files that they leave."""
