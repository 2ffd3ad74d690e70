"""The same physics backwards: how arrival times depend on everything a chain is made of.

Reverse mode, by hand: the tape is walked from its end, and every interval, hit and switch hands the
derivative of one number (the pulled one) with respect to what came out of it on to what went in.
`x_bar` is the derivative with respect to x.  What an interval did is computed again rather than
kept, so memory is linear in the length of the row.
"""
