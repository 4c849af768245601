"""The search for a pose: hypotheses, and what speaks for them."""
