"""Compiled inner loops. Import them where they are called: importing Numba takes longer than a call."""
