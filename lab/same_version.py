"""Metadata hook: pellucid-lab requires the version of pellucid that it was built with."""

from hatchling.metadata.plugin.interface import MetadataHookInterface


class SameVersion(MetadataHookInterface):
    """Adds the requirement on pellucid; without the local part, so that it fits a wheel and a checkout alike."""

    def update(self, metadata: dict) -> None:
        metadata["dependencies"] = [f"pellucid=={metadata['version'].partition('+')[0]}"]
