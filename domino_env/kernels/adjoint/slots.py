"""How the working arrays of the way back are laid out."""

from typing import NamedTuple

from domino_env.kernels.slots import PITCH, record_type

# Lanes of bars: of the five numbers that go down the stack; seeds, the bars of the three sums; of
# friction; and of what one domino and its link are made of, in the order of the parts below.
B_SIN, B_VER, B_WGT, B_JAC, B_DRV = 0 * PITCH, 1 * PITCH, 2 * PITCH, 3 * PITCH, 4 * PITCH
SEED_M, SEED_G, SEED_D, B_MU = 5 * PITCH, 6 * PITCH, 7 * PITCH, 8 * PITCH
B_PITCH, B_GAP, B_THICK = 9 * PITCH, 10 * PITCH, 11 * PITCH  # of p, s, d of the link
B_INERTIA, B_HALF, B_SLENDER = 12 * PITCH, 13 * PITCH, 14 * PITCH
B_RISE, B_TURN = 15 * PITCH, 16 * PITCH  # of e and β, on uneven ground
BARS = 17 * PITCH

# What is gathered of each domino: bars of p, s, d of its link (units of L_i), of its inertia, half
# weight and slenderness; on uneven ground of e and β too. A plain array, so that sums over many
# dominoes vectorise.
PART_PITCH, PART_GAP, PART_THICK, PART_INERTIA, PART_HALF, PART_SLENDER = range(6)
PART_RISE, PART_TURN = 6, 7
PARTS = 8  # on flat ground two are unused


class ShapeBar(NamedTuple):
    """Bars of what a contact needs of its link."""

    pitch: float
    gap: float
    thick: float
    rise: float
    turn: float


WHOLE = record_type(friction=float, gravity=float, push=float)  # bars of what the chain shares

FLUSHING = 3  # a link at the instant of its flush: tip contact before, corner contact after
