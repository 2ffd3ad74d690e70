"""Cache of machine code in files, of which any may be damaged: such code is compiled anew.

A disk that was full, or a machine that lost its power, leaves files that are empty, cut or full of
zeros, of which Numba raises errors, or executes the code. So files have a checksum here.
"""

import pickle
import warnings
import zlib
from typing import Any

from numba.core import caching

from domino_env.core.progress import Advice

_WARNED_FOLDERS: list[str] = []  # folders that cannot be written, for a single warning


class Cache(caching.FunctionCache):
    """Cache of machine code; if no folder can be written, it warns and does not cache."""

    _impl_class: Any = caching.CompileResultCacheImpl

    def __init__(self, py_func: Any) -> None:
        super().__init__(py_func)
        self._cache_file.__class__ = _CheckedFile

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except OSError:  # a file of another user, or a file in place of a folder or the reverse
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:  # the machine code stays in the memory of this process
            self.disable()
            if not _WARNED_FOLDERS:
                _WARNED_FOLDERS.append(self.cache_path)
                warnings.warn(
                    f"compiled code cannot be kept in {self.cache_path} ({error.strerror}), so "
                    "every process compiles it anew, which takes a while: set NUMBA_CACHE_DIR to a "
                    "folder that can be written",
                    Advice,
                    stacklevel=2,
                )


class _CheckedFile(caching.IndexDataCacheFile):
    """Index and data files with checksums; a damaged index is empty, damaged data are missing."""

    def _dump(self, obj: Any) -> Any:
        return super()._dump(_Checked(super()._dump(obj)))

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except OSError:
            raise
        except Exception:  # whatever reading damaged data raises
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except Exception as error:  # Numba compiles after an OSError, and replaces the file
            raise OSError(f"{name} is damaged") from error


class _Checked:
    """Pickled data, of which `pickle` restores the content if its checksum is right."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def __reduce__(self) -> Any:
        return _content, (self.data, zlib.crc32(self.data))


def _content(data: bytes, checksum: int) -> Any:
    if zlib.crc32(data) != checksum:
        raise ValueError("the file is damaged")
    return pickle.loads(data)
