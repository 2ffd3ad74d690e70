"""Compiled physics: functions of numbers and arrays only.

While domino n leads, its lean θ_n is the only free coordinate and u = ω_n² obeys a linear equation
in that angle. So falls (intervals between hits), face impacts and hits are affine maps of u, and
no ODE solver is needed.

    arrays      layout of the working arrays, and the symbols of all kernels
    quadrature  Gauss-Legendre rules and the polynomial through their nodes
    contact     one domino and its torque; its contact, at the tip or at the corner
    stack       all dominoes that lean on the leader, and their changes of contact
    interval    part of a fall without a change of contact: the affine map of u, and the time
    fall        from one hit to the next
    records     arrival times, summary, event tape
    chain       whole chains, batches of them, and patterns that repeat without end
    diagnosis   motion, forces and impulses
    stepping    the same physics by steps in time, for comparison
    ground      dominoes placed along curved ground
    step        one step of the environments
    adjoint     derivatives of arrival times, in reverse mode
    jit         compilation and its cache; short calls before it

Python calls only the entry points of these modules, such as `chain.solve_batch`.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes"
(zmatt.net/domino-physics), eqs. 1-3 and 7-9, restated for unequal dominoes.
"""
