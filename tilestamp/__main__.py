"""``python -m tilestamp``: the command line."""

from tilestamp.experiments.command_line import main

main()
