"""Large objects that many tasks need, sent to each worker once."""

from __future__ import annotations

import uuid
from collections import OrderedDict
from typing import Any

import numpy as np

try:
    import cloudpickle
except ImportError:  # before 1.6, joblib brought its own
    from joblib.externals import cloudpickle

_MAX_UNPACKED = 32  # most objects that a worker keeps unpacked: the data, and the networks of the splits in work
_unpacked: OrderedDict[str, Any] = OrderedDict()


class Shared:
    """An object, which must not change any more, that is packed once, sent to a worker once and unpacked there once.

    Joblib's own workers map its packed array from disk; the size of that array tells Dask and Ray to keep the object.
    """

    def __init__(self, value: Any) -> None:
        self._value = value
        self._key = uuid.uuid4().hex
        self._packed = np.frombuffer(cloudpickle.dumps(value), dtype=np.uint8)

    def __getstate__(self) -> dict[str, Any]:
        return {"_key": self._key, "_packed": self._packed}

    def __sizeof__(self) -> int:
        return object.__sizeof__(self) + self._packed.nbytes

    def get(self) -> Any:
        """The object."""
        if "_value" in vars(self):
            return self._value
        if self._key not in _unpacked:
            _unpacked[self._key] = cloudpickle.loads(self._packed.tobytes())
            while len(_unpacked) > _MAX_UNPACKED:
                _unpacked.popitem(last=False)
        return _unpacked[self._key]
