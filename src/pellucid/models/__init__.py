"""Physics, which knows no data: Python faces of the core's models, and the model cards that carry identified ones."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["cards"])
