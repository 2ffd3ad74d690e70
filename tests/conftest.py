"""Fixtures and settings of all tests."""

import importlib.util
import os
import signal
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

# No deadlines: how long an example takes says something about the machine, not about the program.
# The same examples every time; HYPOTHESIS_PROFILE=search looks for new ones.
settings.register_profile("domino", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "domino"))

# started in the background of a shell, tests would pass on to programs that Ctrl-C is ignored
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def pages() -> ModuleType:
    """The module that makes pages when the site is built, and README's table."""
    spec = importlib.util.spec_from_file_location(
        "pages", Path(__file__).resolve().parents[1] / "docs" / "pages.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
