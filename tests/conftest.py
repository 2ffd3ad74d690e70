"""What all tests share."""

from hypothesis import settings

# no deadlines: how long an example takes says something about the machine, not about the program
settings.register_profile("domino", deadline=None, print_blob=True)
settings.load_profile("domino")
