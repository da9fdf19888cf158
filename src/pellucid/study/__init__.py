"""Studies: what study.toml says of recordings, how sound they are, and the results that are kept of them.

The names are listed in ``__init__.pyi``. Each is imported when it is first used, so that a command that needs none of
them does not wait for them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
