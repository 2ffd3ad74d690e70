"""Templates: lengths on paper are those of the layout."""

import re
import zlib
from itertools import combinations, pairwise

import numpy as np
import pytest

import domino_env as de
from domino_env.view.slots import safety_gaps
from domino_env.view.template import LEAST_MARGIN, MARGIN, PAPERS, _advice, strips, write_template

LAYOUT = de.Layout(np.random.default_rng(1).uniform(0.004, 0.03, 59), 0.0075)
POINT = 0.0254 / 72.0


def text_of(path):
    """Return the content of a PDF with its streams unpacked."""
    data = path.read_bytes()
    streams = re.findall(rb"/FlateDecode.*?stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
    return b"\n".join([data, *map(zlib.decompress, streams)]).decode("latin-1")


@pytest.mark.parametrize("paper", PAPERS)
def test_strips_have_all_dominoes_and_do_not_touch(paper):
    plan = strips(LAYOUT, paper)
    assert len(plan) > plan[-1].sheet == 2  # some are on one sheet
    assert sorted({i for strip in plan for i in strip.dominoes}) == list(range(60))
    for before, after in pairwise(plan):
        assert before.end == pytest.approx(after.begin)
        assert before.sheet < after.sheet or before.middle - after.middle >= LAYOUT.width
    for strip in plan:
        assert strip.end - strip.begin < PAPERS[paper][0]


def test_a_template_has_advice_and_sheets_with_footprints_to_full_scale(tmp_path):
    write_template(LAYOUT, tmp_path / "row.pdf", title="the layout")
    text, plan = text_of(tmp_path / "row.pdf"), strips(LAYOUT)
    box = r"([\d.]+) ([\d.]+) m\n([\d.]+) \2 l\n\3 ([\d.]+) l\n\1 \4 l\n\1 \2 l\nh\n\nS"
    corners = np.array(re.findall(box, text), dtype=float) * POINT
    assert len(corners) >= 60
    np.testing.assert_allclose(corners[:, 2] - corners[:, 0], 0.0075, atol=2e-6)
    np.testing.assert_allclose(corners[:, 3] - corners[:, 1], LAYOUT.width, atol=2e-6)
    first = len(plan[0].dominoes)
    gaps = np.diff(corners[:first, 0])
    np.testing.assert_allclose(gaps, LAYOUT.pitch[: first - 1], atol=2e-6)
    assert len(re.findall(r"/Type /Page[\n ]", text)) == 1 + plan[-1].sheet
    assert "/Title (the layout)" in text
    assert len(strips(de.Layout(LAYOUT.spacing, 0.0075, width=0.1))) == len(plan)


@pytest.mark.parametrize("paper", PAPERS)
def test_viewers_are_asked_not_to_scale_pages(tmp_path, paper):
    """The catalogue is found as viewers find it: trailer, table of objects, object."""
    write_template(LAYOUT, tmp_path / "row.pdf", paper)
    data = (tmp_path / "row.pdf").read_bytes()
    table = data[int(re.search(rb"startxref\n(\d+)", data)[1]) :]
    root = int(re.search(rb"/Root (\d+) 0 R", table)[1])
    offset = int(table.splitlines()[2 + root][:10])
    catalogue = data[offset : data.index(b"endobj", offset)]
    assert catalogue.startswith(b"%d 0 obj" % root)
    assert re.search(rb"/ViewerPreferences\s*<<\s*/PrintScaling\s*/None\s*>>", catalogue)
    assert b"/Version /1.6" in catalogue  # earlier versions do not have /PrintScaling
    pages = re.findall(rb"/MediaBox \[ 0 0 (\S+) (\S+) \]", data)
    assert len(pages) == 1 + strips(LAYOUT, paper)[-1].sheet
    np.testing.assert_allclose(
        np.array(pages, float) * POINT, [PAPERS[paper]] * len(pages), atol=1e-6
    )


def test_headings_do_not_overlap_and_a_domino_on_two_strips_has_two_numbers(tmp_path, monkeypatch):
    pages = []
    monkeypatch.setattr("domino_env.view.template.PdfPages.savefig", lambda _, f: pages.append(f))
    write_template(LAYOUT, tmp_path / "row.pdf", "letter", "a title of thirty letters, long " * 3)
    extents = [text.get_window_extent() for text in pages[0].axes[0].texts]
    assert not any(a.overlaps(b) for a, b in combinations(extents, 2))
    numbers = [t.get_text() for page in pages for t in page.axes[0].texts if t.get_text().isdigit()]
    plan = strips(LAYOUT, "letter")
    assert numbers == [str(i + 1) for strip in plan for i in strip.dominoes]
    assert len(numbers) > LAYOUT.count


@pytest.mark.parametrize("count", [20, 40, 59, 60])
def test_narrower_margins_save_a_sheet(count):
    layout = de.Layout.uniform(count, pitch=0.0212)
    plan, wide = strips(layout), PAPERS["a4"][0]
    whole = plan[-1].end - plan[0].begin
    assert whole >= layout.length + layout.thickness[0]
    fewer = (plan[-1].sheet - 1) * sum(one.sheet == 1 for one in plan)
    assert layout.length + layout.thickness[0] + 0.02 > fewer * (wide - 2 * LEAST_MARGIN)
    for strip in plan:
        assert LEAST_MARGIN - 1e-12 <= strip.margin <= MARGIN
        assert strip.end - strip.begin == pytest.approx(wide - 2 * strip.margin)


def test_a_template_has_title_push_and_time_of_its_scene(tmp_path, output_of):
    scene = de.load_scene("sprint")
    wave = scene.uniform().wave
    scene.uniform().layout.to_csv(tmp_path / "row.csv")
    (tmp_path / "row.scene.toml").write_text(scene.to_toml(), "utf-8")
    output_of("template", tmp_path / "row.csv")
    data = (tmp_path / "row.pdf").read_bytes()
    assert b"/Title (sprint: Forty standard dominoes, as fast as they go)" in data
    sentence = _advice(strips(wave.layout), wave.layout, scene.physics)[-1]
    assert "8 rad/s (0.38 m/s at the top edge)" in sentence
    assert f"after {wave.arrival_times[-1]:.3f} s" in sentence
    stops = _advice(strips(wave.layout), wave.layout, de.Physics(push=2.0))[-1]
    assert "the wave stops" in stops


def test_boxes_of_safety_gaps_are_crossed(tmp_path):
    cross = r"([\d.]+) ([\d.]+) m\n([\d.]+) ([\d.]+) l\n\nS"
    late = len(safety_gaps(LAYOUT, 200.0))
    slanted = []
    for every in (0.0, 200.0):
        write_template(LAYOUT, tmp_path / "row.pdf", safety=every)
        text = text_of(tmp_path / "row.pdf")
        lines = np.array(re.findall(cross, text), dtype=float).reshape(-1, 4)
        slanted.append(int(((lines[:, 0] != lines[:, 2]) & (lines[:, 1] != lines[:, 3])).sum()))
    assert slanted[0] == 0
    assert slanted[1] >= 2 * late > 0
    assert "the crossed boxes" in " ".join(_advice(strips(LAYOUT), LAYOUT, None, 60, {1}))
