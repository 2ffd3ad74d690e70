"""Progress bars: without a terminal, a line at intervals."""

from itertools import count

import pytest

from domino_env.core import progress


@pytest.mark.parametrize(("shown", "lines"), [(None, 3), (False, 0)])
def test_progress_without_a_terminal_is_printed_in_lines(capsys, monkeypatch, shown, lines):
    clock = count(step=10.0)  # ten seconds pass between two readings
    monkeypatch.setattr("tqdm.std.time", lambda: next(clock))
    with progress.progress_bar(shown, total=12, unit=" dominoes") as bar:
        for _ in range(10):
            bar.update(1)
            bar.set_postfix_str("best 0.8", refresh=False)
    printed = capsys.readouterr().err.splitlines()
    assert lines - 1 <= len(printed) <= lines + 1
    for line in printed:
        assert " of 12 dominoes in " in line
        assert "\r" not in line


def test_without_a_standard_error_there_is_no_progress(monkeypatch):
    monkeypatch.setattr("sys.stderr", None)
    for shown in (True, False, None):
        with progress.progress_bar(shown, total=2) as bar:
            bar.update()
            bar.set_postfix_str("nothing")
