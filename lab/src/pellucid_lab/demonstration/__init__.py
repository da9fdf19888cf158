"""Demonstrate the whole workflow in a minute, and measure the coverage of the intervals that it prints."""
