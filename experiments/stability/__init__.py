"""Stability atlas: the parameter that breaks each method, where, what goes wrong, what the cure costs."""
