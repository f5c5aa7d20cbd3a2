"""The commands of ``tilestamp``, a module each."""
