"""Write measurement.png, a synthetic recording that is measured: ``python docs/measurement.py``.

The recording is that of the course with equal gaps, whose first domino is released: one hit in six
is missing, one in three is doubled, with thuds on the table and reverberation.
"""

from __future__ import annotations

import sys
from pathlib import Path

from domino_env import Physics, load_scene, measure, simulate
from domino_env.core.plot_style import write_png

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "tests"))
from recordings import record  # noqa: E402

RATE, FRICTION, SEED = 44100, 0.2, 3


def main() -> None:
    """Synthesise the recording, measure it and write the picture."""
    layout = load_scene("course-released").uniform().layout
    physics = Physics.released(layout, friction=FRICTION)
    sound = record(simulate(layout, physics).arrival_times[1:], SEED, rate=RATE)  # no push
    write_png(measure(sound, RATE, layout, physics).plot(), HERE / "measurement.png")


if __name__ == "__main__":
    main()
