"""Defects of recordings: one file for each kind, which finds every occurrence and says where it is."""
