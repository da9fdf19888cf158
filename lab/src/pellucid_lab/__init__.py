"""The virtual lab: joints with richer physics than the models identified from them, recorded as a lab would."""

import lazy_loader

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
