"""The ledger: every count, price and reported figure as data, so that a change of any of them is a diff to read.

``python -m tests.ledger`` writes it anew; tests compare. It pins, it does not judge: whether a number is right, the
oracles and the measurements say. A commit that changes the ledger says why.
"""
