"""Roads not taken: what the papers leave for future work, built, counted and priced."""
