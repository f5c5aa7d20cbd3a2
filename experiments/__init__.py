"""Questions: one module for each published table or figure, studies, the command line."""
