"""Against silicon: measurements on an H200, predictions beside counters and times."""
