"""Shipped studies: what-if questions to machines, each answered by a run, with its picture and what was found."""
