"""Filters: the mathematics of chapter 4 of *Probabilistic Robotics*, nonparametric filters, as a library.

Beliefs, motion models, sensor models and the compiled kernels under them. Nothing here does input or output,
reads a clock or starts a thread. Import what you need from the module that names it: importing this package
costs nothing.
"""
