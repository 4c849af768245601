"""Compiled inner loops. Import them where they are called: Numba alone takes longer than a call."""
