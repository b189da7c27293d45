"""Compiled arithmetic over columns: random numbers, elementary functions, weights, resampling.

Every kernel takes whole columns and the bounds ``first`` and ``last`` of the block to work on. Beside each
motion and sensor model lies the model's own kernel, in the model's file.
"""

from filters.kernels.compile import compile_all, every_module, gather, kernel

__all__ = ["compile_all", "every_module", "gather", "kernel"]
