"""Picture of a measurement: the sound, the hits, and their differences from the model."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from domino_env.core.colours import PALE, RESULT, SOFT
from domino_env.core.plot_style import LEGEND, new_figure, own_style, style
from domino_env.validation.measurement import HOP, Measurement


@own_style()
def plot(measurement: Measurement) -> Figure:
    """Draw the sound with the hits found and predicted, and the differences of both."""
    m, figure = measurement, new_figure(10.0, 5.6)
    sound, rest = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    title = f"{m.heard} of {m.layout.count - 1} hits heard: {m.mean_speed:.4f} ± "
    title += f"{m.mean_speed_error:.4f} m/s, friction {m.friction:.4f} ± {m.friction_error:.4f}"
    style(sound, title)
    style(rest)
    times = np.arange(len(m.rises)) * HOP - m.start
    shown = (times > -0.05) & (times < m.curve[-1] + 0.1)
    sound.plot(times[shown], m.rises[shown], color=PALE, lw=0.8)
    top = float(m.rises[shown].max())
    heard = m.arrival_times[1:]
    sound.plot(heard, np.full(len(heard), 1.06 * top), "v", color=RESULT, ms=5, label="hits heard")
    sound.plot(m.predicted[1:], np.full(len(heard), 1.14 * top), "|", color=SOFT, ms=8,
               label="hits predicted")  # fmt: skip
    sound.set(ylabel="rise of the loudness", ylim=(0.0, 1.35 * top))
    sound.legend(**LEGEND, ncols=2, loc="upper right")
    rest.axhline(0.0, color=SOFT, lw=0.8)
    rest.plot(heard, 1e3 * m.misfit[1:], "o", color=RESULT, ms=4)
    rest.plot(m.predicted, 1e3 * (m.curve - m.predicted), color=RESULT, lw=1.0)
    rest.set(xlabel="time since the push [s]", ylabel="heard − predicted [ms]")
    return figure
