"""``python -m tilestamp``: the command line."""

from tilestamp.experiments.command_line import main

if __name__ == "__main__":  # processes that multiprocessing starts import it by another name
    main()
