"""What a study asks of electromyograms."""
