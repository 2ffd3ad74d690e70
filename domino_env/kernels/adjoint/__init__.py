"""The same physics in reverse mode: derivatives of arrival times by layout and physics.

The tape is walked from its end; every interval, hit and change of contact propagates the derivative
x_bar of one number from its results to its inputs.  An interval is computed again rather than
stored, so memory is linear in the length of the chain.
"""
