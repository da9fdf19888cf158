"""Do conditions change how people move: from recordings to tests, tables and sentences."""
