"""Reverse mode: derivatives of arrival times with respect to layout and physics.

The bar of x, x_bar, is the derivative of one number with respect to x.  The events of the tape are
processed from the last to the first: every interval, hit and change of contact converts the bars of
its results to those of its inputs.  Functions that do so are named after the function of the
simulation, with _back.  An interval is computed again rather than stored, so memory is linear in
the length of the chain.  For the symbols see `kernels.arrays`.
"""
