"""A study proposed from a lab's own files: roles of their columns, open questions, study.toml, and a report page."""
