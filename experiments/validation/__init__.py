"""Model against machine: predictions beside counters and times, from stored measurements or from the GPU at hand."""
