"""The one place where kernels are compiled.

Kernels are plain NumPy functions; set ``NUMBA_DISABLE_JIT=1`` to step through them uncompiled.
"""

from numba import njit

#: decorator of every kernel: compiled on first call, kept on disk
compiled = njit(cache=True)
#: the same where sums may be taken in any order, so that they run on several numbers at once; NaN stays NaN
compiled_sums = njit(cache=True, fastmath={"reassoc", "contract"})
