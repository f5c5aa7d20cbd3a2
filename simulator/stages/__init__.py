"""One module for each published stage, in its paper's word."""
