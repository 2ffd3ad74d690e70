"""What differs over hills: the overloads of functions for flat ground.

θ counts from each domino's own stand and a link is seen upright from the stand of i+1, so that an
even slope has the contacts of flat ground and only gravity turns; elsewhere a link gains two
constants, a rise e and a turn β (see `slots`).

    links    dominoes and links in the ring
    contact  tip and corner
    fall     the angle of a hit, and what it does
    rows     rows of a batch, and those that are uniform
    forces   forces and what the ground bears
    placing  dominoes placed along a curved ground
    episode  the environments' step
    back     all of it backwards
"""

from domino_env.kernels.ground import back, contact, episode, fall, forces, links, placing, rows

__all__ = ["back", "contact", "episode", "fall", "forces", "links", "placing", "rows"]
