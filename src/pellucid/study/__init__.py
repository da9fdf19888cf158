"""Studies: what study.toml says of recordings, how sound they are, and the results that are kept of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["datasets"])
