"""The virtual lab: joints with richer physics than the models identified from them, recorded as a lab would."""
