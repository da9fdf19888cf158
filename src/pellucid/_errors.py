"""What can go wrong, as types: every message names the file, the channel, what was found and what was expected."""


class PellucidError(ValueError):
    """Base of every error a user can cause or meet; the command line prints it without a traceback."""


class StudyError(PellucidError):
    """study.toml says something that cannot be understood, or contradicts itself."""


class RecordingError(PellucidError):
    """A recording is missing, unreadable, or not fit to be used."""


class DatasetError(PellucidError):
    """A public data set is unknown, or could not be found or fetched."""


class IdentificationError(PellucidError):
    """The recordings cannot carry the model that was asked for."""
