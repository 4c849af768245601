"""The hidden Markov random field and its EM: as published, and in general."""
