"""From raw electromyograms to envelopes, onsets and their quality."""
