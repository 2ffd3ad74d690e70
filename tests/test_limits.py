"""What is too large, too slow or no file at all is refused before memory and time are spent."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import entered, heard, wav

import domino_env as de
from domino_env import limits
from domino_env.command import main
from domino_env.layout import Layout
from domino_env.look.report import read_racers
from domino_env.look.sound import clicks
from domino_env.look.template import sheets
from domino_env.reading import read_bytes
from domino_env.stock import Stock
from optimize.store import open_store


@pytest.mark.parametrize("ending", [".csv", ".json", ".toml", ".wav"])
def test_folders_pipes_and_devices_are_refused_at_once(tmp_path: Path, ending: str) -> None:
    door = {".toml": de.load_scene, ".wav": heard}.get(ending, Layout.read)
    paths = [tmp_path / f"{kind}{ending}" for kind in ("folder", "pipe", "device", "loop", "none")]
    paths[0].mkdir()
    os.mkfifo(paths[1])
    paths[2].symlink_to("/dev/zero")
    paths[3].symlink_to(paths[3])
    for path in [*paths, Path(f"a\0b{ending}")]:
        assert entered(door, path, named="\0" not in path.name) is None
    # of a name too long the system speaks itself
    with pytest.raises(OSError, match="too long"):
        door(tmp_path / ("x" * 5000 + ending))


def test_the_command_line_prints_one_safe_line(tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "a\x1b[2J\nb.csv"
    path.write_text("spacing\n")
    assert main(["simulate", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.endswith("\n")
    assert said[:-1].isprintable()
    assert r"a\x1b[2J\nb.csv" in said
    assert main(["simulate", "x" * 4000 + ".csv"]) == 2
    assert len(capsys.readouterr().err) < 1100


def test_limits_are_set_by_the_environment(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "row.csv"
    Layout([0.02] * 9, 0.0075).to_csv(path)
    Layout([0.02] * 9, 0.0075).to_json(tmp_path / "row.json")
    monkeypatch.setenv("DOMINO_LAYOUT_DOMINOES", "9")
    for name in ("row.csv", "row.json"):
        with pytest.raises(ValueError, match=r"DOMINO_LAYOUT_DOMINOES|at most"):
            Layout.read(tmp_path / name)
    monkeypatch.setenv("DOMINO_LAYOUT_DOMINOES", "10")
    assert Layout.read(path).count == Layout.read(tmp_path / "row.json").count == 10
    monkeypatch.setenv("DOMINO_LAYOUT_BYTES", "100")
    with pytest.raises(ValueError, match=r"a file of .* at most 100 are accepted; .* set DOMINO_L"):
        Layout.read(path)
    for wrong in ("many", "-1", "0", "1e9", "9" * 30, "٣"):
        monkeypatch.setenv("DOMINO_LAYOUT_BYTES", wrong)
        with pytest.raises(ValueError, match="give a whole number of bytes, 1 or more"):
            Layout.read(path)
    monkeypatch.setenv("DOMINO_LAYOUT_BYTES", "")
    assert Layout.read(path).count == 10


def test_a_check_that_would_take_ages_is_not_begun(tmp_path: Path, capsys: Any) -> None:
    Layout([0.02] * 9, 0.0075).to_csv(tmp_path / "row.csv")
    words = ["verify", str(tmp_path / "row.csv")]
    assert main([*words, "--gravity", "1e-6", "--push", "1e-3"]) == 2
    assert re.search(r"row.csv would take .* set DOMINO_ENGINE_MOVES", capsys.readouterr().err)
    assert main([*words, "--steps", "1e-6", "2e-6"]) == 2
    assert "DOMINO_ENGINE_MOVES" in capsys.readouterr().err


def test_a_large_layout_is_held_against_a_large_box_within_bounds() -> None:
    """Not every domino beside every kind: that would be 8 GB."""
    box = Stock(tuple(np.linspace(0.012, 0.004, 1000)), (1000,) * 1000)
    row = np.full(1_000_000, 0.004)
    tracemalloc.start()
    assert box.broken_by(row) == ["1000000 dominoes are 0.004 m thick: the stock has 1000"]
    assert box.broken_by(row[:1000] + 1e-12) == []
    assert box.broken_by(row[:9] + 1e-8)[0].startswith("thickness[0] = 0.00400001 m")
    assert tracemalloc.get_traced_memory()[1] < 200e6
    tracemalloc.stop()


def test_a_store_that_is_too_large_is_not_opened(tmp_path: Path, monkeypatch: Any) -> None:
    open_store(tmp_path / "s.sqlite")
    monkeypatch.setenv("DOMINO_STORE_BYTES", "1000")
    with pytest.raises(ValueError, match="set DOMINO_STORE_BYTES"):
        open_store(tmp_path / "s.sqlite")


def test_every_limit_is_documented() -> None:
    page = (Path(__file__).parent.parent / "docs" / "limits.md").read_text("utf-8")
    for limit in limits.ALL:
        assert f"`{limit.variable}`" in page
        assert f"{limit.default:,}".replace(",", " ") in page


def test_a_wave_that_takes_ages_is_neither_sounded_nor_drawn() -> None:
    slow = de.simulate(Layout([3e5], 1e5, height=1e6), de.Physics(push=1e-3))
    assert slow.arrival_times[-1] > 100.0
    with pytest.raises(ValueError, match=r"a wave of .* s sounds for .* DOMINO_SOUND_SAMPLES"):
        clicks(slow, rate=1_000_000)
    with pytest.raises(ValueError, match=r"a row of .* m takes .* DOMINO_SHEETS"):
        sheets(Layout([3e5], 1e5, height=1e6, width=0.02))


def test_long_rows_are_not_drawn_domino_by_domino(tmp_path: Path, monkeypatch: Any) -> None:
    from domino_env.animation import Runner, frames

    monkeypatch.setenv("DOMINO_SHOWN_DOMINOES", "9")
    row = Layout([0.02] * 9, 0.0075)
    row.to_csv(tmp_path / "row.csv")
    with pytest.raises(ValueError, match=r"row\.csv: it has 10 dominoes a row"):
        read_racers([tmp_path / "row.csv"])
    runner = Runner("row", de.simulate(row, de.Physics()))
    with pytest.raises(ValueError, match="row: it has 10 dominoes a row"):
        next(frames([runner]))
    monkeypatch.delenv("DOMINO_SHOWN_DOMINOES")
    with pytest.raises(ValueError, match=r"s of toppling take .* images"):
        next(frames([runner], slow=1e6))


_WORST = """
import sys
from pathlib import Path
import numpy as np
import domino_env as de
from agents.arrays import read_weights
from domino_env.look.sound import read_wav
from domino_env.scene_files import parse_scene

doors = {
    ".csv": de.Layout.read, ".json": de.Layout.read, ".toml": de.load_scene, ".wav": read_wav,
    ".npz": lambda path: read_weights(path, {"w": ((2, 3), np.dtype("float32"))}),
}
def used(what):
    # not getrusage: the peak that it tells begins with that of whoever started this program
    told = Path("/proc/self/status").read_text()
    return int(told.split(what)[1].split()[0]) * 1024
de.load_scene("sprint")
for path in sorted(Path(sys.argv[1]).iterdir()):
    Path("/proc/self/clear_refs").write_text("5")  # the peak so far is forgotten
    before = used("VmRSS:")
    try:
        doors[path.suffix](path)
    except ValueError:
        pass
    else:
        assert path.name == "promises.wav", path  # what it has of samples is read
    print(path.name, used("VmHWM:") - before)
"""


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="only Linux tells")
def test_the_worst_files_take_little_memory(tmp_path: Path) -> None:
    size = 8 * 2**20
    head = b"spacing,thickness\n"
    zeros = np.lib.format.header_data_from_array_1_0(np.zeros((5000, 10000), np.float32))
    files = {
        "short_lines.csv": head + b"1,1\n" * (size // 4),
        "blank_lines.csv": b"\n" * size,
        "one_line.csv": b"," * size,
        "one_row.csv": head + b'"\n",' * (size // 4),
        "objects.json": b'{"spacing": [' + b"{}," * (size // 3),
        "brackets.json": b"[" * size,
        "one_text.json": b'{"spacing": "' + "😀".encode() * (size // 4) + b'"}',
        "keys.toml": b"".join(b"[a%d.b.c.d]\n" % i for i in range(60_000)),
        "long_keys.toml": b"a." * 400_000 + b"a = 1\n",
        "array.toml": b"x = [" + b"[],1.0," * 130_000 + b"]",
        "promises.wav": wav(b"\0\0" * 1000, 44100, 1, 16, 2**32 - 1),
        "rate.wav": wav(b"\1\0" * 500_000, 1, 1, 16, 10**6),
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    with (
        zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("w.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(member, zeros)
        for _ in range(200):
            member.write(bytes(1_000_000))
    assert (tmp_path / "bomb.npz").stat().st_size < 10**6
    surroundings = {"NUMBA_NUM_THREADS": "1", "DOMINO_LAYOUT_DOMINOES": "100000"}
    told = subprocess.run(
        [sys.executable, "-W", "error", "-c", _WORST, str(tmp_path)],
        capture_output=True, text=True, check=False, env=os.environ | surroundings,
    )  # fmt: skip
    assert told.returncode == 0, told.stdout + told.stderr
    took = dict(line.split() for line in told.stdout.splitlines())
    assert len(took) == len(files) + 1
    # at once: the file, its text (four bytes a sign), and what a million bytes of keys become
    keys = ("keys.toml", "array.toml")
    assert max(int(n) for name, n in took.items() if name not in keys) < 8 * size, took
    assert max(int(took[name]) for name in keys) < 400_000_000, took


def test_reading_what_shrinks_or_grows_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"abc")
    assert read_bytes(path, limits.Limit("DOMINO_TEST", 3, "bytes", "a test")) == b"abc"
    with pytest.raises(ValueError, match="a file of 3 bytes, where at most 2 are accepted"):
        read_bytes(path, limits.Limit("DOMINO_TEST", 2, "bytes", "a test"))
