"""The decorators that compile kernels.

Kernels are plain NumPy functions: with ``NUMBA_DISABLE_JIT=1`` they run uncompiled, to be stepped through.  numba keeps
the compiled code beside the source (``cache=True``) and renews it when the kernel's own file changes, but not when a
kernel of another file that it calls does: delete ``__pycache__`` then.
"""

from numba import njit

#: decorator of a kernel: compiled on first call, kept on disk
compiled = njit(cache=True)
#: the same with sums in any order, so that they become vector instructions; NaN stays NaN
compiled_sums = njit(cache=True, fastmath={"reassoc", "contract"})
#: the same for a few lines that are put into their callers: a call with views of arrays takes longer than they do
inlined = njit(inline="always")
