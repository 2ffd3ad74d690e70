"""Search methods for layouts, without learning, compared with the uniform baseline.

from optimize import search, METHODS

result = search("sprint", method="cma", budget=5000, seed=0)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
