"""Questions to a study: which variant is the best where, what lies on the front, what matters, what is better still."""
