"""The virtual lab: joints whose physics is richer than the models identified from them, recorded as a real lab would."""
