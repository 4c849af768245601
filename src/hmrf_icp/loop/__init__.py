"""Algorithm 1: match, reject, align, and when it stops."""
