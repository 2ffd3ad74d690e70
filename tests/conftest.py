"""What all tests share."""

import signal

from hypothesis import settings

# no deadlines: how long an example takes says something about the machine, not about the program
settings.register_profile("domino", deadline=None, print_blob=True)
settings.load_profile("domino")

# started in the background of a shell, tests would pass on to programs that Ctrl-C is ignored
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
