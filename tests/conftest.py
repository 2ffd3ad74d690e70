"""Fixtures and settings of all tests."""

import gc
import importlib.util
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import settings

from domino_env.cli.main import main
from domino_env.kernels.jit.interpreted import compiled

gc.set_threshold(20_000, 20, 100)  # collections take a tenth of the time otherwise

# No deadlines: how long an example takes says something about the machine, not about the program.
# The same examples every time; HYPOTHESIS_PROFILE=search looks for new ones.
settings.register_profile("domino", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "domino"))

# started in the background of a shell, tests would pass on to programs that Ctrl-C is ignored
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Leave the modules and the tests out of garbage collections."""
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def compile_kernels() -> Iterator[None]:
    """Compile kernels at their first calls: tests call them more often than a first user does."""
    with compiled():
        yield


@pytest.fixture(scope="session")
def script() -> Callable[[str], ModuleType]:
    """A function that loads a script of docs/ or examples/ as a module, without running it."""

    def load(path: str) -> ModuleType:
        root = Path(__file__).resolve().parents[1]
        spec = importlib.util.spec_from_file_location(Path(path).stem, root / path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture(scope="session")
def pages(script: Callable[[str], ModuleType]) -> ModuleType:
    """The module that fills the tables of pages, and adds pages to the site."""
    return script("docs/pages.py")


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A headless browser, where there is one."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs Selenium")
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium here")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in ("headless=new", "no-sandbox", "disable-gpu", "window-size=1280,1300"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield window
    window.quit()


@pytest.fixture
def phone(chromium: Any) -> Iterator[None]:
    """The browser with the screen of a phone."""
    size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    chromium.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    yield
    chromium.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.fixture
def output_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """A function that runs a command which succeeds and returns its output."""

    def run(*words: object) -> str:
        assert main([str(word) for word in words]) == 0
        output = capsys.readouterr()
        # quiet where there is no terminal, except for the notice of a first compilation
        assert all(line.startswith("compiling") for line in output.err.splitlines())
        return output.out

    return run


@pytest.fixture
def error_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """A function that runs a command which is rejected and returns its message of one line."""

    def run(*words: object) -> str:
        assert main([str(word) for word in words]) == 2
        output = capsys.readouterr()
        # these two may print the scene or its physics first
        assert output.out.count("\n") <= (words[0] in ("optimize", "render"))
        (error,) = (line for line in output.err.splitlines() if not line.startswith("compiling"))
        assert error.startswith("domino: ")
        assert error.isprintable()
        return error

    return run
