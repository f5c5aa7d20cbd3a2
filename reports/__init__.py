"""Drawing: tables, plots and pages from plain tables; it computes nothing and imports nothing of ours."""
