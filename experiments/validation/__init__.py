"""Model against machine: predictions beside counters and times, by kernel, from stored measurements or a GPU at hand."""
