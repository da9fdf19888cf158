"""What a study asks of an orthosis."""
