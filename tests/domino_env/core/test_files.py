"""Files: errors name the requested file."""

import errno
from pathlib import Path

import pytest

from domino_env.core.files import write_text


def test_the_error_of_a_read_only_folder_names_the_requested_file(tmp_path, monkeypatch):
    def fail(path, *_, **__):
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    monkeypatch.setattr(Path, "open", fail)
    monkeypatch.setattr(Path, "unlink", fail)  # even of a file that is not there
    with pytest.raises(OSError, match=r"/layout\.csv cannot be written: Read-only file system$"):
        write_text(tmp_path / "layout.csv", "")
