"""The paper's experiment on any sequence: who registers what, from how far, and how well."""
