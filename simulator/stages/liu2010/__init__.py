"""Liu et al. 2010, FreePipe: one thread a triangle."""
