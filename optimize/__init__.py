"""Search methods for layouts, without learning, compared with the uniform baseline.

    from optimize import METHODS, search

    result = search("sprint", method="cma", budget=5000, seed=0)
    result.layout, result.score, result.gain

Names are imported when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
