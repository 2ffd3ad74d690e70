"""Sources of measured chains: values, publication, method, and facts that are not published.

Every TOML file in `sources/` is a source. A source may have several readings: interpretations of
the experiment that differ in what is not known about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from domino_env.core.checks import numbers
from domino_env.core.files import errors_with_path, read_text
from domino_env.core.models import Number, Size, Table, read_model
from domino_env.physics.standard import HEIGHT, WIDTH
from domino_env.scenes.io.reading import parse_document

Quantity = Literal["frequency", "speed", "time"]
# units of x as they are shown
UNITS = {"m": "mm", "thickness": "thicknesses", "height": "heights", "width": "widths"}
FREQUENCY_UNCERTAINTY = 0.02  # relative, of a frequency without a stated one
TEMPLATE = 0.0002  # [m] standard uncertainty of the spacings that a template gives


class Setting(Table, frozen=True):  # type: ignore[misc]
    """Conditions of an experiment in one reading.

    Attributes
    ----------
    height, thickness, width
        Sizes of the dominoes [m].
    gravity
        Acceleration of gravity [m/s²].
    measured
        Part of the wave: far from the push (`steady`), or from the push to the last hit (`row`).
    count
        Number of dominoes.
    push
        Angular velocity of the first domino [rad/s]; it has no influence on a steady wave.
    x_is, x_unit
        Meaning of the x of a chain, gap or pitch, and its unit: 1 m or a size of the dominoes.
    x_uncertainty, x_shift
        Standard uncertainty of x, and a shift that is added to every x [x_unit].
    floor
        Floor of the chains that are compared; None for those on all floors.
    """

    thickness: Size
    height: Size = HEIGHT
    width: Size = WIDTH
    gravity: Size = 9.81
    measured: Literal["steady", "row"] = "steady"
    count: Annotated[int, Meta(ge=3, le=10_000)] = 100
    push: Size = 8.0
    x_is: Literal["gap", "pitch"] = "gap"
    x_unit: Literal["m", "thickness", "height", "width"] = "m"
    x_uncertainty: Annotated[float, Meta(ge=0.0)] = 0.0
    x_shift: Number = 0.0
    floor: str | None = None

    @property
    def x_length(self) -> float:
        """Length of the unit of x [m]."""
        return 1.0 if self.x_unit == "m" else float(getattr(self, self.x_unit))

    def format_x(self, x: float) -> str:
        """Return an x with its unit; one in metres is shown in millimetres."""
        return f"{1e3 * x if self.x_unit == 'm' else x:.4g} {UNITS[self.x_unit]}"

    def pitch(self, x: float) -> float:
        """Return the pitch at an x [m]."""
        length = (x + self.x_shift) * self.x_length
        return length if self.x_is == "pitch" else length + self.thickness

    def speed(self, quantity: Quantity, x: float, value: float) -> float:
        """Convert a measured frequency [1/s], speed [m/s] or time [s] at an x to a speed [m/s]."""
        if quantity == "time":
            value = (self.count - 1) / value
        return value if quantity == "speed" else value * self.pitch(x)


class MeasuredChain(Table):
    """Chains of one spacing on one floor, and their measured value.

    Attributes
    ----------
    x
        Gap or pitch, as the setting says, in its unit.
    value, uncertainty
        Measured frequency [1/s], speed [m/s] or time [s], and its standard uncertainty.
    floor
        Name of the floor; None if all chains have the same one.
    """

    x: Size
    value: Size
    uncertainty: Size
    floor: str | None = None


class Friction(Table):
    """Friction between dominoes, from an independent measurement.

    Attributes
    ----------
    value, uncertainty
        Coulomb coefficient, and its standard uncertainty.
    """

    value: Annotated[float, Meta(ge=0.0)]
    uncertainty: Size


class Source(Table):
    """Measurements of one author.

    Attributes
    ----------
    quantity, unit
        Measured quantity, and its unit as it is shown.
    setting
        Setting of the experiment.
    chains
        The measurements (`rows` in a file), in the order of the file.
    title, reference
        Subject, and where it is published: page, table or figure.
    read
        Parts of the publication that were read for this file.
    method, errors
        Method of measurement, and origin of the uncertainties.
    unknown
        Facts that are not published and have to be assumed.
    instead
        Tables of other readings: a label (`what`), and the keys of `setting` that differ.
    friction
        Friction between dominoes, where it was measured independently.
    name
        Name of the file.
    """

    quantity: Quantity
    unit: str
    setting: Setting
    chains: Annotated[tuple[MeasuredChain, ...], Meta(min_length=1)] = msgspec.field(name="rows")
    title: str = ""
    reference: str = ""
    read: str = ""
    method: str = ""
    errors: str = ""
    unknown: tuple[str, ...] = ()
    instead: tuple[dict[str, Any], ...] = ()
    friction: Friction | None = None
    name: str = ""

    def __post_init__(self) -> None:
        """Check that in every reading there are chains, and that each can stand and be hit."""
        if not all(isinstance(reading.get("what"), str) for reading in self.instead):
            raise ValueError(
                "instead: 'what' is missing or no text: describe how the reading differs"
            )
        for setting in (self.setting, *self.readings.values()):
            if not self.chains_of(setting):
                raise ValueError(
                    f"rows: no chain is on the floor '{setting.floor}': name the floor of a chain"
                )
            for chain in self.chains_of(setting):
                gap = setting.pitch(chain.x) - setting.thickness
                if not 0.0 < gap < setting.height:
                    raise ValueError(
                        f"rows: x = {chain.x} is a gap of {gap:.6g} m: give more than 0 and less "
                        f"than the height, {setting.height} m"
                    )

    @classmethod
    def from_frequencies(
        cls, pitches: Sequence[float], frequencies: Sequence[float], **setting: float
    ) -> Source:
        """Make a source of hit frequencies, each with a standard uncertainty of 2 %.

        Parameters
        ----------
        pitches, frequencies
            (K,) pitch [m] and hits per second [1/s] of each chain.
        **setting
            Other fields of the `Setting`.

        Returns
        -------
        Source
            The measurements.

        Raises
        ------
        ValueError
            For pitches that no chain can have, frequencies that are not positive, and different
            numbers of them.
        """
        given = {"pitches": pitches, "frequencies": frequencies}
        x, values = (np.atleast_1d(numbers(name, value)).tolist() for name, value in given.items())
        if len(x) != len(values):
            raise ValueError(f"{len(x)} pitches and {len(values)} frequencies: give one for each")
        chains = [
            {"x": pitch, "value": value, "uncertainty": FREQUENCY_UNCERTAINTY * value}
            for pitch, value in zip(x, values, strict=True)
        ]
        return read_model(cls, {
            "name": "given", "title": "chains that were given", "quantity": "frequency",
            "unit": "1/s", "setting": setting | {"x_is": "pitch"}, "rows": chains,
        })  # fmt: skip

    @property
    def readings(self) -> dict[str, Setting]:
        """Settings of the other readings, by their labels."""
        own, readings = msgspec.to_builtins(self.setting), {}
        for reading in self.instead:
            changes = {key: value for key, value in reading.items() if key != "what"}
            readings[str(reading["what"])] = read_model(Setting, own | changes, "instead")
        return readings

    def chains_of(self, setting: Setting) -> tuple[MeasuredChain, ...]:
        """Return the chains on the floor of a setting; all chains if it has none."""
        return tuple(chain for chain in self.chains if setting.floor in (None, chain.floor))


def read_source(path: Path) -> Source:
    """Read a file of measurements.

    Parameters
    ----------
    path
        TOML file.

    Returns
    -------
    Source
        The measurements, under the name of the file.

    Raises
    ------
    ValueError
        If the file is not valid; the message has the file, the key, its value and the accepted
        range.
    OSError
        If the file cannot be read.
    """
    with errors_with_path(path):
        document = parse_document(read_text(path), str(path))
        return read_model(Source, {**document, "name": path.stem})


def shipped_sources() -> dict[str, Source]:
    """Read all shipped sources, by name."""
    folder = Path(__file__).with_name("sources")
    return {path.stem: read_source(path) for path in sorted(folder.glob("*.toml"))}
