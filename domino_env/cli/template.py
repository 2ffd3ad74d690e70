"""Write a template of a layout at 1:1, for paper or a laser cutter.

A PDF has the numbered footprints of all dominoes, on sheets of paper. An SVG has the outline of a
strip with a slot for each domino, in pieces: red lines are cut, blue texts engraved.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import add_layout, add_options, beside, number, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino template`."""
    add_layout(parser)
    size, kind = "size of the sheets (a4)", "kind of the file (that of FILE, or pdf)"
    parser.add_argument("--paper", default="a4", choices=["a4", "letter"], help=size)
    parser.add_argument("--format", choices=["pdf", "svg"], help=kind)
    template = "output file (LAYOUT with the ending .pdf or .svg)"
    parser.add_argument(
        "--out", "--pdf", metavar="FILE", type=output(".pdf", ".svg"), help=template
    )
    safety = "mark three dominoes at every MM of the row that are left out until the end"
    add_options(
        parser,
        ("safety", number("mm", low=0.0), "MM", None, safety),
        ("tolerance", number("mm", low=0.0), "MM", 0.3, "SVG: slots larger than a domino by MM"),
        ("piece", number("mm", above=0.0), "MM", 300.0, "SVG: largest length of a piece"),
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the template, and print the name of its file and instructions for its use."""
    from domino_env.core.files import amount, one_line, write_text
    from domino_env.scenes.io.reading import layout_name, read_layout, scene_beside
    from domino_env.view.slots import strip_svg
    from domino_env.view.template import write_template

    source, safety = arguments.layout, arguments.safety or 0.0
    scene = scene_beside(source)
    layout = read_layout(source, scene)
    ending = f".{arguments.format}" if arguments.format else ".pdf"
    target = arguments.out or beside(source, ending)
    if arguments.format and target.suffix.lower() != ending:
        raise ValueError(f"{target}: name a {ending} file for --format {arguments.format}")
    title, physics = f"Layout {layout_name(source)}", None
    if scene:
        title = f"{one_line(scene.name, 40)}: {one_line(scene.title, 60)}"
        physics = scene.physics
    designed = layout.count
    layout = scene.row(layout) if scene else layout
    if target.suffix.lower() == ".svg":
        svg = strip_svg(layout, arguments.tolerance, arguments.piece, safety)
        write_text(target, svg)
        count = amount(svg.count('class="piece"'), "piece")
        text = f"{count} with {amount(layout.count, 'slot')}: cut red lines, engrave blue texts"
    else:
        text = write_template(layout, target, arguments.paper, title, physics, designed, safety)
    print(f"{target}: {text}")
    return 0
