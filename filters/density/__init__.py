"""Density extraction (4.3.4): what is said of a belief. A file for each kind of density."""
