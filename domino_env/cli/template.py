"""Write a paper template of a layout at 1:1.

The PDF has the numbered footprints of all dominoes, on sheets of paper.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import add_layout, add_options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino template`."""
    add_layout(parser)
    size = "size of the sheets (a4)"
    parser.add_argument("--paper", default="a4", choices=["a4", "letter"], help=size)
    template = "output file (LAYOUT with the ending .pdf)"
    add_options(parser, ("pdf", output(".pdf"), "FILE", None, template))


def run(arguments: argparse.Namespace) -> int:
    """Write the template, and print the name of its file and instructions for its use."""
    from domino_env.core.files import layout_name, one_line
    from domino_env.scenes.io.reading import read_layout, scene_beside
    from domino_env.view.template import write_template

    source = arguments.layout
    scene = scene_beside(source)
    layout = read_layout(source, scene)
    target = arguments.pdf or source.with_suffix(".pdf")
    title, physics = f"Layout {layout_name(source)}", None
    if scene:
        title = f"{one_line(scene.name, 40)}: {one_line(scene.title, 60)}"
        physics = scene.physics
    designed = layout.count
    layout = scene.row(layout) if scene else layout
    text = write_template(layout, target, arguments.paper, title, physics, designed)
    print(f"{target}: {text}")
    return 0
