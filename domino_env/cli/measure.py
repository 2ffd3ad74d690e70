"""Measure the chain that was built, from recordings of its sound.

RECORDING is a sound or film of one whole wave (.wav; others are decoded by ffmpeg). The layout is
that of --layout, or equal gaps of --uniform. With several of these options, each followed by its
recordings, the first layout is compared with the others:

domino measure --layout uniform.csv a1.wav a2.wav --layout best.csv b1.wav b2.wav
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from domino_env.cli import options

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
    from domino_env.physics.physics import Physics
    from domino_env.scenes.scene import Scene
    from domino_env.validation.measurement import Measurement

FIELDS = (
    "mean_speed mean_speed_error friction friction_error push push_error heard arrival_times "
    "arrival_error predicted misfit_rms misfit_max model_rejected verdict"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino measure`."""
    parser.add_argument("recordings", metavar="RECORDING", nargs="*", type=Path, help="recordings")
    for name, first, text in (
        ("layout", "LAYOUT", "layout file, .csv or .json, and its recordings"),
        ("uniform", "COUNT,PITCH", "number of dominoes and pitch [mm] of equal gaps, recordings"),
    ):
        parser.add_argument(
            f"--{name}", nargs="+", action=_AppendChain, const=name, dest="chains",
            metavar=(first, "RECORDING"), default=[], help=text,
        )  # fmt: skip
    options.add_options(
        parser,
        ("thickness", options.SIZE, "MM", 7.5, "thickness of the dominoes of --uniform [mm]"),
        ("height", options.SIZE, "MM", 48.0, "height of the dominoes of --uniform [mm]"),
        ("gravity", options.GRAVITY, "M/S2", None, "gravity [m/s²] (of the scene, or 9.81)"),
        ("push", options.push, "RAD/S", None,
         "expected push [rad/s], or 'released' (of the scene, or 8)"),
        ("scene-out", options.output(".toml"), "FILE", None,
         "write a scene with the measured friction and push, for domino optimize"),
        ("source-out", options.output(".toml"), "FILE", None,
         "write a source of measurements of equal gaps, for domino validate"),
    )  # fmt: skip
    options.add_flags(parser, json="print the results as JSON in SI units")
    options.add_out_option(parser, "none", literal=False)


def run(arguments: argparse.Namespace) -> int:
    """Measure each recording, print the results, and write the files that were requested."""
    from domino_env.core.results import document
    from domino_env.validation.measured_gain import measured_gain

    chains, groups = _chains(arguments), []
    is_single = sum(len(chain.recordings) for chain in chains) == 1
    for chain in chains:
        measured = []
        for path in chain.recordings:
            try:
                measured.append(_measure(path, chain, arguments))
            except (ValueError, OSError) as error:
                if is_single:
                    raise
                # the other recordings are measured all the same
                print(f"not measured: {error}", file=sys.stderr)
        if measured:
            groups.append((chain, measured))
    results = []
    for chain, measured in groups:
        documents = [document(m, FIELDS) for m in measured]
        result: dict[str, Any] = {"layout": chain.name, "recordings": documents}
        if measured is not groups[0][1]:
            gain = measured_gain(groups[0][1], measured)
            result["gain"] = document(gain, "gain interval predicted further")
            if not arguments.json:
                print(f"{chain.name} over {groups[0][0].name}: {gain}")
        results.append(result)
    if arguments.json:
        options.print_json(results)
    if groups:
        _write_files(arguments, groups)
    return 0 if groups else 1


class _AppendChain(argparse.Action):
    """Append the name of an option and its values, in the order of the command line."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option: Any = None) -> None:
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), (self.const, *values)])


class _Chain(NamedTuple):
    """Layout of a command line, with its recordings."""

    name: str
    layout: Layout
    physics: Physics
    scene: Scene | None
    recordings: list[Path]


def _chains(arguments: argparse.Namespace) -> list[_Chain]:
    """Return the layouts of the command line with their recordings, checked before any work."""
    from domino_env.physics.layout import Layout
    from domino_env.physics.physics import Physics
    from domino_env.scenes.io.reading import read_layout, scene_beside
    from domino_env.validation.measured_gain import require_equal_dominoes

    given = {name: getattr(arguments, name) for name in ("gravity", "push")}
    given = {name: value for name, value in given.items() if value not in (None, options.RELEASED)}
    chains = []
    for option, name, *recordings in arguments.chains:
        scene = None
        if option == "uniform":
            sizes = {key: 1e-3 * getattr(arguments, key) for key in ("thickness", "height")}
            count, pitch = _parse_uniform(name)
            row = Layout.uniform(count, pitch=pitch, **sizes)
        else:
            scene = scene_beside(Path(name))
            layout = read_layout(name, scene)
            row = scene.row(layout) if scene else layout
        physics = (scene.physics if scene else Physics()).replace(**given)
        chains.append(_Chain(name, row, physics, scene, [*map(Path, recordings)]))
    if arguments.push == options.RELEASED:
        chains = [c._replace(physics=options.released(c.physics, c.layout)) for c in chains]
    if not chains:
        raise ValueError("no layout: name it by --layout FILE or --uniform COUNT,PITCH")
    if arguments.recordings and len(chains) > 1:
        raise ValueError(
            f"{arguments.recordings[0]}: with several layouts, write the recordings of each behind "
            "its option: --layout a.csv a1.wav --layout b.csv b1.wav"
        )
    chains[0].recordings.extend(arguments.recordings)
    for chain in chains:
        if not chain.recordings:
            raise ValueError(f"{chain.name}: no recordings: name at least one")
    if arguments.out:
        stems = Counter(path.stem for chain in chains for path in chain.recordings)
        if repeated := [stem for stem, times in stems.items() if times > 1]:
            raise ValueError(
                f"several recordings are named {repeated[0]}: rename them, as --out has a picture "
                "and a table under the name of each"
            )
    first = chains[0]
    if arguments.scene_out and first.scene is None:
        require_equal_dominoes(first.layout, "a scene")
    if arguments.source_out:
        for chain in chains:
            require_equal_dominoes(chain.layout, "a source")
    return chains


def _parse_uniform(text: str) -> tuple[int, float]:
    """Return the number of dominoes and the pitch [m] of COUNT,PITCH [mm]."""
    try:
        count, pitch = text.split(",")
        return int(count), 1e-3 * float(pitch)
    except ValueError:
        raise ValueError(f"'{text}': write COUNT,PITCH [mm], as in 40,24") from None


def _measure(path: Path, chain: _Chain, arguments: argparse.Namespace) -> Measurement:
    """Measure a recording, print the result, and write its picture and table."""
    from domino_env.core.files import errors_with_path
    from domino_env.core.plot_style import write_png
    from domino_env.core.tables import write_csv
    from domino_env.validation.measurement import measure
    from domino_env.view.sound import read_recording

    samples, rate = read_recording(path)
    with errors_with_path(path):
        result = measure(samples, rate, chain.layout, chain.physics)
    if not arguments.json:
        print(f"{path}: {result.verdict}")
    if arguments.out:
        write_png(result.plot(), arguments.out / f"{path.stem}.png")
        names = "domino", "arrival_s", "predicted_s"
        columns = range(chain.layout.count), result.arrival_times, result.predicted
        lines = zip(*columns, strict=True)
        write_csv(arguments.out / f"{path.stem}-hits.csv", names, lines)
    return result


def _write_files(
    arguments: argparse.Namespace, groups: list[tuple[_Chain, list[Measurement]]]
) -> None:
    """Write the scene of --scene-out and the source of --source-out."""
    from domino_env.core.files import write_text
    from domino_env.scenes.scene import Scene
    from domino_env.scenes.tables import format_toml
    from domino_env.validation.measured_gain import source_document

    if arguments.scene_out:
        chain, measured = groups[0]
        friction, push = (
            round(sum(getattr(m, name) for m in measured) / len(measured), 4)
            for name in ("friction", "push")
        )
        if chain.physics.is_released(chain.layout):
            push = chain.physics.push
        physics = chain.physics.replace(friction=friction, push=push)
        scene = chain.scene
        if scene is None:
            a = chain.layout
            scene = Scene(
                title="Dominoes whose friction was measured by their sound", count=a.count,
                height=float(a.height[0]), width=a.width, density=float(a.density[0]),
                thickness=(float(a.thickness[0]),) * 2,
                spacing=(0.002, round(0.8 * float(a.height[0]), 6)),
            )  # fmt: skip
        scene = scene.replace(physics=physics, name=arguments.scene_out.stem)
        write_text(arguments.scene_out, scene.to_toml())
        print(f"{arguments.scene_out}: friction {friction:g}, push {push:g} rad/s; search with "
              f"domino optimize {arguments.scene_out}", file=sys.stderr)  # fmt: skip
    if arguments.source_out:
        document = source_document([measured for _, measured in groups])
        write_text(arguments.source_out, format_toml(document))
        print(f"{arguments.source_out}: compare with the model by domino validate "
              f"{arguments.source_out}", file=sys.stderr)  # fmt: skip
