"""One module for each published system; it reads like its overview figure."""
