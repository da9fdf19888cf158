"""A study proposed from a lab's own files: what they hold, what is asked, study.toml, and the page that shows why."""
