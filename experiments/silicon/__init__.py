"""Against silicon: measurements on an H200, mixes read from its machine code, predictions beside counters and times."""
