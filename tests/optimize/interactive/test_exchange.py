"""Drafts as files and links: exports have the same score, and invalid files are rejected."""

import base64
import json
import zlib
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np
import pytest

import domino_env as de
from optimize.interactive import exchange
from optimize.interactive.draft import SPACING, Draft

SPRINT = de.load_scene("sprint")


@pytest.fixture
def draft() -> Draft:
    return Draft.uniform(SPRINT).with_size(SPACING, 3, 0.0123456789)


@pytest.mark.parametrize("name", ["sprint", "downhill", "hills", "sprint-thickness", "magnify"])
def test_files_and_links_restore_the_same_design(name: str) -> None:
    draft = Draft.uniform(de.load_scene(name))
    files = {
        f"row.{name}": exchange.make_file(draft, name).read()
        for name in ("scene.toml", "layout.csv")
    }
    other = exchange.read_files(files, SPRINT)
    link = exchange.make_link(draft)
    linked = exchange.read_link(parse_qs(link[1:])["design"][0])
    expected = draft.scene, draft.layout, draft.score
    for found in (other, linked, exchange.open_draft(f"http://localhost:1/{link}")):
        assert (found.scene, found.layout, found.score) == expected


def test_reports_and_templates_are_exported(draft: Draft) -> None:
    assert exchange.make_file(draft, "template.pdf").read().startswith(b"%PDF")
    page = exchange.make_file(draft, "report.html").read().decode()
    assert '"uniform baseline"' in page
    assert f"{draft.score:.6f} m/s" in page


def test_a_layout_is_opened_with_its_scene_or_one_that_fits(draft: Draft, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    draft.layout.to_csv(run / "layout.csv")
    alone = exchange.open_draft(run)
    assert (alone.layout, alone.scene.name) == (draft.layout, "own")
    (run / "scene.toml").write_text(SPRINT.to_toml())
    for source in (run, run / "layout.csv"):
        assert exchange.open_draft(source).scene == SPRINT
    wide = de.Layout(np.linspace(0.001, 0.045, 11), 0.008)
    wide.to_csv(tmp_path / "wide.csv")
    received = exchange.read_files({"wide.csv": (tmp_path / "wide.csv").read_bytes()}, SPRINT)
    assert received.scene.spacing == (0.001, 0.045)
    assert received.layout == wide
    hills = exchange.read_files({"hills.toml": de.load_scene("hills").to_toml().encode()}, SPRINT)
    assert hills.scene.name == "hills"
    with pytest.raises(ValueError, match=r"allows 0\.04 m"):
        exchange.open_draft(de.Layout([0.02], 0.008, [0.04, 0.05]))


WRONG = {
    "row.csv": b"spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n",
    "words.csv": b"hello",
    "row.json": b'{"spacing": [0.01], "thicknes": 0.008}',
    "mine.toml": b"objective = 3",
    "latin.toml": b"title = '\xe9'",
}


@pytest.mark.parametrize("name", WRONG)
def test_an_invalid_file_has_the_message_of_the_command_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(WRONG[name])
    with pytest.raises(ValueError, match=name) as expected:
        exchange.open_draft(path)
    with pytest.raises(ValueError, match=name) as error:
        exchange.read_files({name: WRONG[name]}, SPRINT)
    ours, theirs = (str(e.value).replace(f"{tmp_path}/", "") for e in (error, expected))
    assert ours == theirs


@pytest.mark.parametrize(("files", "words"), [
    ({"x.png": b""}, r"x\.png: give a layout"),
    ({}, ": give a layout"),
    ({"one.csv": b"spacing,thickness\n,.01\n"}, "one domino has no gap: give a layout of two"),
    ({"a.csv": b"", "b.csv": b""}, r"a\.csv, b\.csv: give a layout"),
    ({"../../etc/passwd": b"root"}, r"etc/passwd: give a layout"),
    ({"long.csv": b"spacing,thickness\n" + b".02,.01\n" * 5999 + b",.01\n"}, "6,000 dominoes: g"),
])  # fmt: skip
def test_other_uploads_are_rejected(files: dict[str, bytes], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        exchange.read_files(files, SPRINT)


def packed(data: bytes) -> str:
    return base64.urlsafe_b64encode(zlib.compress(data)).decode()


@pytest.mark.parametrize("text", [
    "", "€", "AAAA", packed(b"[1, 2"), packed(b"{}"), packed(b"[" * 10**6), packed(b" " * 10**8),
    packed(json.dumps(["count = 3", "spacing"]).encode()),
])  # fmt: skip
def test_a_damaged_link_is_rejected(text: str) -> None:
    with pytest.raises(ValueError, match="the row in the link: "):
        exchange.read_link(text)
